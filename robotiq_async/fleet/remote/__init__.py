"""The client's side: a hand that an agent on another host serves."""
