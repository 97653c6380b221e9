"""A live view of a hand in Foxglove."""
