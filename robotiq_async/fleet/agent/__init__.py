"""Serves the hands of one host."""
