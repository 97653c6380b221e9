"""The network between agents and clients; only this package knows zenoh."""
