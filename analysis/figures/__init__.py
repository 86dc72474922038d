"""What a study draws."""
