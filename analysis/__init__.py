"""Arrays in, metrics and verdicts out; knows no process and no network."""
