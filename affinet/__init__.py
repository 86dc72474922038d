"""affinet: a scenario in, a run out."""
