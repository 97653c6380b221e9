"""What the values 0..255 mean on one's own gripper: measurements and their pictures."""
