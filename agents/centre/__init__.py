"""The filter that hears everybody."""
