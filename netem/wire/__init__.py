"""What travels between processes: keys, messages, sessions."""
