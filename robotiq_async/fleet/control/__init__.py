"""The lease, and the admission of requests. Pure."""
