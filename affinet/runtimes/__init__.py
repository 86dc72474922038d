"""A plan flown: in this process, side by side, or over processes."""
