"""Recordings of a hand: written, read, exported."""
