"""The meaning of the values 0..255 on your own gripper: measurements and plots of them."""
