"""What a recording is made of: MCAP, and tables."""
