"""Commands that take a run directory: of a run that is over, or of one that flies."""

from __future__ import annotations

import argparse
from pathlib import Path

from affinet.cli.options import values

OVERLAID = (".png", ".pdf", ".svg")
STILL, MOVING = (".png", ".pdf", ".svg", ".jpg"), (".mp4", ".gif")
PAGE = "report.html"
# As affinet.verdicts.export has them, whose libraries are more than a command line needs.
FORMATS = {
    "parquet": "a folder of tables that pandas, Polars and DuckDB read",
    "netcdf": "a file of labelled arrays that xarray, MATLAB and R open",
    "mcap": "a file that Foxglove and PlotJuggler open",
    "csv": "a folder of tables as text",
}


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add them."""
    _add_watch(commands)
    _add_render(commands)
    _add_compare(commands)
    _add_diff(commands)
    _add_report(commands)
    _add_export(commands)
    _add_fit(commands)
    _add_inject(commands)


def _add_watch(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    watch = commands.add_parser("watch", help="watch what was flown: one run, or several on one timeline")
    watch.add_argument("directories", nargs="+", type=Path, metavar="RUN", help="run directories")
    watch.add_argument("--serve", action="store_true", help="as a page for a browser on this machine, until Ctrl-C")


def _add_render(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    render = commands.add_parser("render", help="a picture or a film of runs, for a paper or a page")
    render.add_argument("directories", nargs="+", type=Path, metavar="RUN", help="run directories, side by side")
    render.add_argument(
        "--out", required=True, type=_picture, metavar="FILE", help=f"ends in {', '.join((*STILL, *MOVING))}"
    )
    render.add_argument("--at", type=float, metavar="S", help="of a picture: which moment (default: the last)")
    render.add_argument(
        "--speed",
        type=values.between(1e-3, 1e6),
        default=4.0,
        metavar="X",
        help="of a film: times real time (default: %(default)g)",
    )
    render.add_argument(
        "--fps", type=values.up_to(60), default=15, metavar="N", help="frames a second (default: %(default)s)"
    )
    render.add_argument(
        "--from", dest="begins", type=float, default=0.0, metavar="S", help="of a film: its first moment"
    )
    render.add_argument("--to", dest="ends", type=float, metavar="S", help="of a film: its last moment")


def _add_compare(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    compare = commands.add_parser(
        "compare", help="runs beside each other: settings that differ, figures, and where they part"
    )
    compare.add_argument("directories", nargs="+", type=Path, metavar="RUN", help="run directories, two or more")
    compare.add_argument(
        "--out", type=Path, metavar="FILE", help=f"their curves over each other, as a picture: {', '.join(OVERLAID)}"
    )
    compare.add_argument("--json", action="store_true", help="print one JSON object")


def _add_diff(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    diff = commands.add_parser(
        "diff",
        help="where a run that fails parts from one that passes, and what was lost before",
        description="Of the agent that goes wrong most, the ticks in which its error, the error of its estimates and the age "
        "of its news leave those of the other run for good, and what the links to it lost in the seconds before.",
    )
    diff.add_argument("run", type=Path, metavar="RUN", help="directory of the run that fails")
    diff.add_argument("other", nargs="?", type=Path, metavar="OTHER", help="directory of the run that passes")
    diff.add_argument("--seed", type=values.seed, metavar="N", help="or fly one with this seed, in this process")
    diff.add_argument(
        "--at",
        type=values.between(0.0, 1e9),
        metavar="S",
        help="when it fails, as the check says (default: when an agent is farthest off)",
    )
    diff.add_argument("--json", action="store_true", help="print one JSON object")


def _add_report(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    report = commands.add_parser("report", help="a page of a run or a study, in one file for any browser")
    report.add_argument("directory", type=Path, metavar="RUN|STUDY", help="the directory that it left")
    report.add_argument("--out", type=Path, metavar="FILE", help=f"default: {PAGE} in the directory")


def _add_export(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    says = "; ".join(f"{name}: {form}" for name, form in FORMATS.items())
    export = commands.add_parser(
        "export",
        help=f"a run as {', '.join(FORMATS)}",
        description=f"Write a run in a format of other tools, to a place where nothing is. {says}.",
    )
    export.add_argument("directory", type=Path, metavar="RUN", help="the run directory")
    export.add_argument("--to", choices=FORMATS, required=True, help="which format")
    export.add_argument("--out", type=Path, metavar="PATH", help="default: beside the run directory, called like it")


def _add_fit(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    fit = commands.add_parser(
        "fit", help="an autoregressive model of the inputs of a run, for filters that predict them"
    )
    fit.add_argument("directory", type=values.path, metavar="RUN", help="the run directory")
    fit.add_argument(
        "--order", type=values.count, default=1, metavar="P", help="ticks it takes in (default: %(default)s)"
    )
    fit.add_argument("--json", action="store_true", help="print one JSON object")


def _add_inject(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    inject = commands.add_parser("inject", help="change the air of a run while it flies over processes")
    inject.add_argument("directory", type=values.path, metavar="RUN", help="the run directory")
    verbs = inject.add_subparsers(dest="verb", required=True, metavar="VERB")
    cut = verbs.add_parser("cut", help="links that carry nothing: 1-2, 1->2, leaders->followers")
    cut.add_argument("links", nargs="+")
    partition = verbs.add_parser("partition", help="groups between which nothing passes: 1,2,3/4,5,6,7")
    partition.add_argument("groups", type=values.groups)
    lose = verbs.add_parser("lose", help="a probability with which messages are lost on top")
    lose.add_argument("loss", type=float, metavar="P")
    lose.add_argument("--links", nargs="+", default=["all"], help="default: all")
    for verb in (cut, partition, lose):
        verb.add_argument(
            "--for", dest="lasts", type=float, metavar="S", help="simulated seconds (default: until healed)"
        )
    for verb in (cut, partition):
        verb.add_argument(
            "--in-flight", choices=["drop", "deliver", "hold"], default="drop", help="default: %(default)s"
        )
    verbs.add_parser("heal", help="end what was injected; what the scenario scripts stays")
    verbs.add_parser("show", help="what is imposed now")


def _picture(text: str) -> Path:
    path = Path(text)
    if path.suffix not in (*STILL, *MOVING):
        raise argparse.ArgumentTypeError(f"{text!r}: give a name that ends in {', '.join((*STILL, *MOVING))}")
    return path
