"""Control laws: one family a file."""
