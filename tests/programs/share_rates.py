"""Print the table of docs/accuracy.md: how often a share of runs is decided how, on planted runs."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
from planted_shares import table

if __name__ == "__main__":
    print("\n".join(table()))
