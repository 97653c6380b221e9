"""A hand that an agent on another host serves."""
