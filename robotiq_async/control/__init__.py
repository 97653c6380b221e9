"""What decides: the state machine, and what to write after what has been read. Pure."""
