"""`python -m netem`: the medium of a run."""

from netem.process import main

main()
