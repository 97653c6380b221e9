"""What the values 0..255 mean on your own gripper: measurements and plots of them."""
