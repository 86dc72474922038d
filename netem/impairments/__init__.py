"""What a profile does to messages: one model a file."""
