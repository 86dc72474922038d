"""What happened, as arrays."""
