"""What happened, as a recording and tables on disk."""
