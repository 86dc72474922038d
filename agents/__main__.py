"""`python -m agents`: one agent of a run."""

from agents.process import main

main()
