"""The lease, and which requests are admitted. Pure."""
