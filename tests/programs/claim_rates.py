"""Print the table of docs/accuracy.md: how often each check of claims decides how, on planted data."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
from planted import PLANTED, RUNS, rates

DRAWS = 1000


def main() -> None:
    """A row for each check."""
    print(f"| {RUNS} runs, {DRAWS} draws: holds, undecided, does not hold | true by | just false | false by as much |")
    print("|---|---|---|---|")
    for one in PLANTED:
        found = [rates(one, by, DRAWS) for by in (one.margin, -1e-9, -one.margin)]
        cells = " | ".join(f"{each.holds}, {each.undecided}, {each.fails}" for each in found)
        print(f"| `{one.name}`: {one.says}; by {one.margin:g} | {cells} |")


if __name__ == "__main__":
    main()
