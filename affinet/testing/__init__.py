"""Fault-injection tests under pytest: the plugin (fixture `swarm`), and hypothesis strategies of faults (docs/testing.md)."""
