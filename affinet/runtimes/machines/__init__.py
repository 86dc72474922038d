"""A run over several machines: who joins it, what each has to have in common, and how it is started and watched."""
