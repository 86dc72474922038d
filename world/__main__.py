"""`python -m world`: the world of a run."""

from world.process import main

main()
