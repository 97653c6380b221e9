"""A hand as messages: recordings, viewers, metrics. Each behind its extra."""
