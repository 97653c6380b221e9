"""``robotiq-async record``, and what becomes of a recording."""
