"""Parts of serial lines: the ports of a machine, the silence between frames, several grippers on one line."""
