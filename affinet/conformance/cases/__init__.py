"""What docs/protocol.md demands of an agent, as cases: one matter a file."""
