"""The layer below everything: clocks, timers, event loops and threads, logging, optional packages."""
