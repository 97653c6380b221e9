"""What agents and clients say to each other: names, requests, answers, statuses. Pure."""
