"""The agent, which serves the hands of one host."""
