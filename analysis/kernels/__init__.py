"""Functions of one agent, link or edge, compiled, which broadcast over any leading axes."""
