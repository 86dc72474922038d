"""Whether an agent, in whatever language, speaks as docs/protocol.md says: flights against it alone, and what they show."""
