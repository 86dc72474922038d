"""What every process of a run does: how it starts, says that it lives, fails and leaves."""
