"""The air between agents: keys, wire format, impairments and the medium that applies them.

Start at `medium.py` to see where a loss is decided and where it is counted; each impairment it composes is a
file of its own (`loss.py`, `delay.py`, `cut.py`, `absence.py`).
"""
