"""A small certificate authority for the agents and clients of a fleet, in a folder."""
