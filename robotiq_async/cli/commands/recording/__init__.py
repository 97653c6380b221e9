"""``robotiq-async record``, and the commands that use a recording."""
