"""Hands on other hosts, over zenoh: an agent that serves them, remote hands, a view of the fleet."""
