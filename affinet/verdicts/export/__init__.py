"""What a run leaves, in the formats of others."""
