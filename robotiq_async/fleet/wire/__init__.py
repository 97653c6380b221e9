"""Messages between agents and clients: names, requests, answers, statuses. Pure."""
