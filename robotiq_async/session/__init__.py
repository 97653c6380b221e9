"""One run of a hand, from start() to stop(): the task that polls, and the waits of callers beside it."""
