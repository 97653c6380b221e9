"""Inputs and outputs of a hand: names, requests, status, results, errors, units. Pure."""
