"""The command that takes a file of link data."""

from __future__ import annotations

import argparse
from pathlib import Path

from affinet.cli.options import values

# As affinet.traces.formats and affinet.traces.fitting have them, whose arrays are more than a command line needs.
FORMATS = ("table", "ping", "iperf3", "mahimahi", "one", "contacts", "intervals", "emane", "setdest", "bonnmotion")
MODELS = ("best", "bernoulli", "gilbert", "gilbert-elliott", "markov")


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add it."""
    trace = commands.add_parser(
        "trace",
        help="link data as people have them: what they come to, a chain fitted to them, a profile",
        description="Show what a file of link data comes to, link by link; fit a chain to its losses; write a profile.",
    )
    trace.add_argument("file", type=values.path, metavar="FILE", help="ping, iperf3 --json, contacts, ...")
    trace.add_argument("--format", choices=FORMATS, metavar="FORMAT", help=f"one of: {', '.join(FORMATS)}")
    trace.add_argument(
        "--interval", type=values.positive, metavar="S", help="of a ping without times (default: 1 s, and it is said)"
    )
    trace.add_argument(
        "--begins",
        type=values.moment,
        metavar="S",
        help="time of the file that is 0: of a clock on the wall (default: 0)",
    )
    trace.add_argument(
        "--curve", metavar="TOML", help="what passes at a distance, signal or pathloss: [[-90,0],[-70,1]]"
    )
    trace.add_argument(
        "--dt",
        type=values.positive,
        metavar="S",
        help="step of the chain, and of looks at nodes that move (of these: 1 s)",
    )
    trace.add_argument("--fit", choices=MODELS, help="fit this chain; best: the one of the least BIC")
    trace.add_argument("--profile", type=Path, metavar="FILE", help="write a profile, called like the file, as TOML")
    trace.add_argument("--json", action="store_true", help="print one JSON object")
