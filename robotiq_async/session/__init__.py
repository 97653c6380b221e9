"""One run of a hand, from start() to stop(): the task that polls, and what others wait for beside it."""
