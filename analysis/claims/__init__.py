"""What a paper claims, held against runs."""
