"""The tick against its floor, in one run: the same messages through bare Zenoh, with no computing.

    python bench/lockstep.py [--ticks 1500] [--rounds 3] [--swarms corridor hexa]

Prints, for 7 and 10 agents: the floor (as many processes, the same keys, message sizes, logins and access control, nobody
computes), the tick of GA-RKF with recording on and off, their ratio, the real-time factor, the start, and memory. Machines are
noisy: look at ratios, and at the spread of the rounds.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from affinet.planning import making as planning
from affinet.planning.plan import Plan
from affinet.runtimes.launcher import Launcher
from affinet.scenario import loading
from netem.wire import messages
from netem.wire.arrays import CODE, TRUTH, packed
from netem.wire.session import ENVIRONMENT, HUB, WORLD, agent_name


def sizes(plan: Plan) -> dict[str, int]:
    """Typical packed sizes of a tick's messages."""
    number = np.random.default_rng(0).normal
    dimension, links = plan.world.formation.dimension, len(plan.world.links)
    agents = plan.world.formation.agents
    degree = round(links / agents)
    heard = round(degree * plan.scenario.network.availability)
    nothing = b""
    map_ = packed(number(size=(dimension, dimension)))
    said: dict[str, dict[str, Any]] = {
        "input": {"velocity": packed(number(size=dimension))},
        "measurement": {"neighbours": [1] * heard, "measured": packed(number(size=(heard, dimension)))},
        "theta": {"local": map_, "feasible": b"\1", "consensus": map_, "started": b"\1"},
    }
    broadcasts = [
        messages.pack(messages.Broadcast(k=500, src=1, channel=name, seq=500, payload=fields))
        for name, fields in said.items()
    ]
    told = {
        "sense": messages.pack(
            messages.Sense(
                k=500,
                src=WORLD,
                seq=500,
                last=False,
                measured=packed(number(size=(links, dimension))),
                position=packed(number(size=(agents, 2))),
                motion=None,
                sightings=None,
                fired=[],
            )
        ),
        "seen": messages.pack(
            messages.SenseInbox(
                k=500,
                src=HUB,
                seq=500,
                clock=500,
                neighbours=[1] * heard,
                measured=packed(number(size=(heard, 2))),
                position=None,
                motion=None,
                sighting=None,
            )
        ),
        "heard": messages.pack_exchange(500, 500, broadcasts * heard),
        "act": messages.pack(
            messages.Act(
                k=500,
                src=1,
                seq=500,
                input=packed(number(size=dimension)),
                estimate=packed(number(size=(degree, dimension))),
                known=packed(np.ones(degree), TRUTH),
                covariance=packed(number(size=(degree, dimension * (dimension + 1) // 2))),
                psi=0.1,
                feasible=True,
                reports={},
                heard=500,
            )
        ),
        "journal": messages.pack(
            messages.Journal(
                k=500,
                src=HUB,
                seq=500,
                verdicts=packed(np.ones((4, links)), CODE),
                odd=nothing,
                apart=nothing,
                late=0,
                dropped=nothing,
                released=nothing,
                handed=[9] * agents,
                injected=None,
            )
        ),
    }
    return {name: len(data) for name, data in told.items()} | {"said": len(broadcasts[-1])}


def floor_tick(plan: Plan, ticks: int) -> float:
    """Seconds of a tick in which nobody computes."""
    agents, size = plan.world.formation.agents, sizes(plan)
    with tempfile.TemporaryDirectory() as private:
        names = {WORLD: WORLD, HUB: HUB, **{str(agent): agent_name(agent) for agent in range(1, agents + 1)}}
        endpoint, users = f"unixsock-stream/{private}/z.sock", Path(private) / "users"
        passwords = {role: secrets.token_hex(8) for role in names}
        users.write_text("".join(f"{name}:{passwords[role]}\n" for role, name in names.items()))
        started = {}
        for role, name in names.items():
            started[role] = process = subprocess.Popen(
                [sys.executable, str(Path(__file__).with_name("floor.py"))],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env=os.environ | ENVIRONMENT,
            )
            told = {"role": role, "agents": agents, "ticks": ticks, "size": size, "users": str(users)}
            _tell(process, json.dumps(told | {"login": [endpoint, name, passwords[role]]}))
        for process in started.values():
            _said(process)
        for role in [HUB, *(role for role in names if role not in (HUB, WORLD)), WORLD]:
            _tell(started[role], "go")
        tick = float(_said(started[WORLD]))
        for process in started.values():
            process.communicate("done\n", timeout=20)
    return tick


def _tell(process: subprocess.Popen[str], line: str) -> None:
    told = process.stdin
    assert told is not None
    told.write(line + "\n")
    told.flush()


def _said(process: subprocess.Popen[str]) -> str:
    said = process.stdout
    assert said is not None
    return said.readline()


def fly(plan: Plan) -> tuple[float, float, float]:
    """Seconds of a tick, seconds to the first tick, and the largest agent's memory in MB, its share of what is shared."""
    with tempfile.TemporaryDirectory() as out:
        flight = Launcher(plan, Path(out), watch=lambda *_: None).fly()
    if flight.failure or flight.uninstructed:
        raise SystemExit(f"the run failed: {flight.failure}, {flight.uninstructed} lost")
    memory = max(process["pss_mb"] for process in flight.processes if process["role"] == "agent")
    return flight.wall_s / plan.world.ticks, flight.start_s, memory


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=1500)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--swarms", nargs="+", default=["corridor", "hexa"], metavar="SCENARIO")
    options = parser.parse_args()
    print("| swarm | floor, ms | tick, ms | ratio | x real time | recording | start, s | agent, MB (PSS) |")
    print("|---|---|---|---|---|---|---|---|")
    for name in options.swarms:
        duration = f"time.duration={options.ticks / 100:g}"
        on = planning.make(loading.load(name, [duration]))
        off = planning.make(loading.load(name, [duration, "record.enabled=false"]))
        rounds = [(floor_tick(on, options.ticks), fly(on), fly(off)[0]) for _ in range(options.rounds)]
        bare = statistics.median(r[0] for r in rounds)
        tick = statistics.median(r[1][0] for r in rounds)
        ratio = statistics.median(r[1][0] / r[0] for r in rounds)
        cost = statistics.median(r[1][0] / r[2] - 1.0 for r in rounds)
        start = statistics.median(r[1][1] for r in rounds)
        memory = max(r[1][2] for r in rounds)
        spread = f"{min(r[1][0] for r in rounds) * 1e3:.2f} to {max(r[1][0] for r in rounds) * 1e3:.2f}"
        print(
            f"| {name}, {on.world.formation.agents} agents | {bare * 1e3:.2f} | {tick * 1e3:.2f} ({spread}) | {ratio:.2f} "
            f"| {on.world.dt / tick:.2f} | {cost:+.0%} | {start:.2f} | {memory:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
