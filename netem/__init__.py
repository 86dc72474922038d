"""The network between agents: what is said of links, what impairs them, and what becomes of every message.

Start at `medium/medium.py` to see where a loss is decided; `medium/verdict.py` counts it, `medium/journal.py` writes it down.
Each impairment that `medium/link_model.py` composes is a file of its own in `impairments/`, each kind of fault in `faults/`.
"""
