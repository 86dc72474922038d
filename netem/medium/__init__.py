"""Messages offered in a tick, and what becomes of each."""
