"""How far off a swarm and its estimates are."""
