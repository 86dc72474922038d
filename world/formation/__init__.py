"""Where agents should be: nominal formations, their stress, manoeuvres."""
