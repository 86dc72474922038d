"""A run as a page of HTML that needs nothing beside it."""
