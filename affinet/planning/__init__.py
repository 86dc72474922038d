"""A scenario checked and made ready to fly: plans, and all that is found on the way."""
