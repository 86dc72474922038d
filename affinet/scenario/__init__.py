"""A TOML in, a typed scenario out; every error with its file, key and what would be right."""
