"""What a timeline imposes on links and agents, tick by tick."""
