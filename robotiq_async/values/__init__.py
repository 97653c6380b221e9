"""What goes into a hand and what comes out of one: names, requests, status, results, errors, units. Pure."""
