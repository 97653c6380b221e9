"""When polls are due, and by which clock."""
