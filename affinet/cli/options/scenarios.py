"""Commands that take a scenario, or one that was flown, and fly it here."""

from __future__ import annotations

import argparse

from affinet.cli.options import values
from affinet.scenario import files


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add them."""
    run = commands.add_parser("run", help="fly a scenario", description="Fly a scenario and leave a run directory.")
    check = commands.add_parser("check", help="say whether a scenario can fly, before anything starts")
    replay = commands.add_parser("replay", help="fly again what was flown, and compare")
    determinism = commands.add_parser(
        "check-determinism", help="fly a scenario twice in process and once over processes, and compare every bit"
    )
    for command in (run, check, determinism):
        add_scenario(command)
    replay.add_argument("directory", type=values.path, metavar="DIR", help="the run directory")
    replay.add_argument(
        "--verdicts",
        action="store_true",
        help="take every verdict from its journal, whatever the seed; without it the models decide again",
    )
    for command in (run, check, determinism, replay):
        add_overrides(command)
    for command in (run, replay):
        command.add_argument("--runtime", choices=["processes", "inprocess"], help="default: processes")
        add_output(command)
    _add_many_runs(run)


def add_scenario(command: argparse.ArgumentParser) -> None:
    """Add the scenario."""
    command.add_argument("scenario", help=f"a TOML file, or one of: {', '.join(files.shipped('scenarios'))}")


def add_overrides(command: argparse.ArgumentParser) -> None:
    """Add what changes it."""
    command.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="override any key, like time.dt=0.02"
    )
    command.add_argument("--estimator", metavar="NAME", help="agents.estimator")
    command.add_argument("--law", metavar="NAME", help="agents.law")
    command.add_argument(
        "--availability", metavar="P", help="network.availability, the probability that a message gets through"
    )
    command.add_argument("--seed", metavar="N", help="seed")
    command.add_argument("--duration", metavar="S", help="time.duration, in simulated seconds")
    command.add_argument("--dt", metavar="S", help="time.dt, the length of a tick, in simulated seconds")
    command.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def add_output(command: argparse.ArgumentParser) -> None:
    """Add where the run is left, and what shows it while it flies."""
    command.add_argument("--out", type=values.path, metavar="DIR", help="run directory (default: runs/SCENARIO-TIME)")
    shown = command.add_mutually_exclusive_group()
    shown.add_argument("--view", action="store_true", help="watch in a Rerun viewer while it flies")
    shown.add_argument(
        "--serve", action="store_true", help="watch in a browser on this machine while it flies, and on until Ctrl-C"
    )


def _add_many_runs(run: argparse.ArgumentParser) -> None:
    many = run.add_argument_group("many runs, in this process, which leave a table and no directory")
    many.add_argument("--seeds", type=values.seeds, metavar="A-B", help="a run with each of these seeds")
    many.add_argument(
        "--sweep",
        action="append",
        default=[],
        metavar="KEY=V,V,...",
        help="runs with each of these values; several combine",
    )
    many.add_argument("--check", metavar="CHECKER", help="what else must hold of each run, like 'bounded(5)'")
