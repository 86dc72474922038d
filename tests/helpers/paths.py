"""Where the repository is, and what tests start and look at."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BENCH = ROOT / "bench"
HELPERS = ROOT / "tests" / "helpers"
PROGRAMS = ROOT / "tests" / "programs"
