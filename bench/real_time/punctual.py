"""How punctual a run in real time is: delays asked for and achieved, what the medium adds to Zenoh, and who is late.

    python bench/real_time/punctual.py [--agents 10] [--rate 100] [--per-process 1] [--seconds 10] [--busy 0] [--repeat 3]
        [--keep docs/punctual.json]

The last agent notes when each of its messages arrives; Zenoh alone is measured while the same swarm flies. `--busy` loops take
processors away meanwhile. A figure is the median of the repeats, with the least and the largest. `--keep` puts the runs in
place of those of the same settings.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from affinet.planning import making
from affinet.planning.plan import Plan
from affinet.runtimes.run import fly
from affinet.scenario import loading
from netem.core import channels
from netem.medium import deliveries

_HERE = Path(__file__).parent


def _spin() -> None:
    while True:
        pass


@contextmanager
def busy(loops: int) -> Iterator[None]:
    """So many processes that do nothing but compute."""
    processes = [multiprocessing.Process(target=_spin, daemon=True) for _ in range(loops)]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


def plan_of(agents: int, rate: float, seconds: float, heard: Path, per_process: int = 1) -> Plan:
    """A ring of agents with uniform delays of 5 to 45 ms, the last of which is the probe."""
    probe = json.dumps(f"{sys.executable} {_HERE.parent / 'carried' / 'agent.py'} {heard}")
    angles = 2.0 * np.pi * np.arange(agents) / agents
    nodes = (5.0 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)).round(6).tolist()
    edges = [f"{n + 1}-{(n + step) % agents + 1}" for n in range(agents) for step in (1, 2)]
    file = heard.with_suffix(".toml")
    file.write_text(
        f"""
        [formation]
        nodes = {json.dumps(nodes)}
        edges = {json.dumps(edges)}
        leaders = [1, 2, 3]
        [manoeuvre]
        preset = "hover"
        [time]
        dt = {1.0 / rate}
        duration = {seconds}
        mode = "real"
        real = {{ late = 60, timers = [{{ phase = 0.5, listens = 0.3 }}] }}
        [sensing]
        sigma = 0.1
        [agents]
        estimator = "none"
        law = "rest"
        per_process = {per_process}
        programs = {{ "{agents}" = {probe} }}
        [network]
        profile = "slow"
        [network.profiles.slow]
        delay = {{ model = "uniform", mean = 0.025, jitter = 0.02 }}
        [record]
        enabled = false
        """
    )
    return making.make(loading.load(str(file)))


def flown(agents: int, rate: float, seconds: float, loops: int, per_process: int) -> dict[str, Any]:
    """One run, and Zenoh alone beside it."""
    with tempfile.TemporaryDirectory() as folder:
        heard, out = Path(folder) / "heard", Path(folder) / "run"
        plan = plan_of(agents, rate, seconds, heard, per_process)
        direct = [sys.executable, str(_HERE / "direct.py"), str(seconds), str(rate), "200"]
        with busy(loops), subprocess.Popen(direct, stdout=subprocess.PIPE, text=True) as alone:
            outcome = fly(plan, "processes", out, lambda *_: None)
            took = json.loads(alone.communicate()[0])
        assert outcome.timing is not None, outcome.reasons
        table = deliveries.read(out / deliveries.FILE)
        columns = [table[name].to_pylist() for name in ("src", "dst", "channel", "content")]
        asked = dict(zip(zip(*columns, strict=True), table["asked_s"].to_pylist(), strict=True))
        errors = [
            seconds - asked[src, agents, channel, content]
            for src, channel, content, seconds in _heard(heard, plan.channels)
        ]
    lateness = outcome.timing.lateness
    return {
        "messages": len(errors),
        "error_ms": _quantiles(errors),
        "direct_ms": _quantiles(took),
        "ratio": statistics.median(errors) / statistics.median(took),
        "medium_ms": [outcome.timing.delays.p50_ms, outcome.timing.delays.p99_ms] if outcome.timing.delays else None,
        "late_ms": {name: [of.p50_ms, of.p99_ms, of.max_ms] for name, of in lateness.items()},
        "missed": outcome.timing.missed,
        "moments": sum(of.moments for of in lateness.values()),
        "unsaid": outcome.messages["dropped"].get("unsaid", 0),
    }


def _heard(file: Path, names: Sequence[str]) -> Iterator[tuple[int, str, int, float]]:
    """Of each broadcast, who said it on which channel in which tick, and how many seconds later it arrived."""
    told, named = np.load(file), {channels.code(name): name for name in names}
    for (_, content, code, src, _), seconds in zip(told["heard"].tolist(), told["took_s"].tolist(), strict=True):
        if not np.isnan(seconds):
            yield src, named[code], content, seconds


def _quantiles(seconds: Sequence[float]) -> list[float]:
    return [round(1000.0 * float(value), 4) for value in np.quantile(seconds, [0.5, 0.99])]


def main() -> None:
    """Measure, print, and write down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=10)
    parser.add_argument("--rate", type=float, default=100.0, help="ticks in a second")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--busy", type=int, default=0, help="loops that compute meanwhile")
    parser.add_argument("--per-process", type=int, default=1, help="agents that a process carries")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--keep", type=Path, metavar="FILE")
    given = parser.parse_args()
    runs = [flown(given.agents, given.rate, given.seconds, given.busy, given.per_process) for _ in range(given.repeat)]
    for run in runs:
        print(json.dumps(run))
    if given.keep:
        called = ", ".join(f"{name} {getattr(given, name):g}" for name in ("agents", "rate", "per_process", "busy"))
        kept = json.loads(given.keep.read_text()) if given.keep.exists() else {}
        given.keep.write_text(json.dumps(kept | {called: runs}, indent=1) + "\n")


if __name__ == "__main__":
    main()
