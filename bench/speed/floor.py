"""One process of a floor: the messages of a tick, and nobody computes (`floors.py` starts these)."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from speed.lines import Lines, Pipes, Zenoh, ZeroMQ

GO = "go\n"
CHANNELS = ("input", "measurement", "theta")


def be_hub(lines: Lines, agents: int, ticks: int, size: Mapping[str, int]) -> None:
    """Relay as the medium does."""
    sense, said = lines.hears("sense"), lines.hears("said")
    inboxes = [lines.says(f"inbox/{agent}") for agent in range(1, agents + 1)]
    journal = lines.says("journal")
    for _ in ticks_of_rounds(lines, ticks):
        sense()
        for inbox in inboxes:
            inbox(b"." * size["seen"])
        journal(b"." * size["journal"])
        for _ in range(agents * len(CHANNELS)):
            said()
        for inbox in inboxes:
            inbox(b"." * size["heard"])


def be_world(lines: Lines, agents: int, ticks: int, size: Mapping[str, int]) -> None:
    """Sense, and wait for everybody; prints the seconds of a tick, round by round."""
    acts, journal, sense = lines.hears("act"), lines.hears("journal"), lines.says("sense")
    began = 0.0
    for tick in ticks_of_rounds(lines, ticks):
        if tick == 0:
            began = time.perf_counter()
        sense(b"." * size["sense"])
        journal()
        for _ in range(agents):
            acts()
        if tick == ticks - 1:
            print((time.perf_counter() - began) / ticks, flush=True)


def be_agent(lines: Lines, agent: int, ticks: int, size: Mapping[str, int]) -> None:
    """Answer."""
    inbox = lines.hears(f"inbox/{agent}")
    said = [lines.says(f"said/{agent}/{channel}") for channel in CHANNELS]
    act = lines.says(f"act/{agent}")
    for _ in ticks_of_rounds(lines, ticks):
        inbox()
        for broadcast in said:
            broadcast(b"." * size["said"])
        inbox()
        act(b"." * size["act"])


def ticks_of_rounds(lines: Lines, ticks: int) -> Iterator[int]:
    """Say that it is ready, and number the ticks of each round that somebody lets begin."""
    lines.await_everybody()
    print("ready", flush=True)
    while sys.stdin.readline() == GO:
        yield from range(ticks)


def _lines(told: Mapping[str, Any]) -> Lines:
    folder = Path(told["folder"])
    match told["transport"]:
        case "pipes":
            return Pipes(folder)
        case "ZeroMQ":
            return ZeroMQ(folder)
        case _:
            return Zenoh(told["login"], told["agents"], str(folder / "users"), routes=told["role"] == "hub")


def main() -> None:
    """Be the role that standard input names."""
    told = json.loads(sys.stdin.readline())
    role, agents, ticks, size = told["role"], told["agents"], told["ticks"], told["size"]
    lines = _lines(told)
    if role == "hub":
        be_hub(lines, agents, ticks, size)
    elif role == "world":
        be_world(lines, agents, ticks, size)
    else:
        be_agent(lines, int(role), ticks, size)
    lines.leave()


if __name__ == "__main__":
    main()
