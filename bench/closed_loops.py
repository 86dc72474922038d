"""How fast the closed loop settles, or runs away, in each phase of a timeline: law, gain, and what completes missing edges.

    python bench/closed_loops.py [paper-000-laws] [--set time.dt=0.01]

Of every case of a study whose estimator is `ral` or `conral`: these are linear where the graph stays as it is, and so the
formation is, axis by axis, a linear system of the followers' positions, of what the law sums up and of the consensus maps.
One tick of estimator and law, as they fly, gives it, without noise. Prints its slowest rate (1/s) in each phase, as if that
went on for ever: below 0 it settles, 0 is a mode without control, above it grows. Laws that hear velocities are left out.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from affinet.planning import making, phases
from affinet.planning.phases import Graph
from affinet.planning.plan import Plan
from affinet.scenario import loading
from affinet.studies import study
from agents.brief import Own
from agents.estimators.conral import Agreement
from agents.exchange import Heard
from agents.laws.single import Integral
from analysis.models.arrays import Array

_LINEAR = ("ral", "conral")
_NOTHING = 1e-6  # 1/s: what rounding makes of 0


def main() -> None:
    """The rates of all cases of a study, as a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", nargs="?", default="paper-000-laws")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--cases", type=int, help="only so many")
    options = parser.parse_args()
    asked = study.load(options.study)
    print("| case | estimator | phases from (s), slowest rate (1/s) |")
    print("|---|---|---|")
    for labels, plan in _cases(asked, options.set, options.cases):
        found = [f"{phase.start * plan.world.dt:g}: {_rate(plan, phase.graph):.3g}" for phase in _phases(plan)]
        print(f"| {', '.join(labels)} | {plan.scenario.agents.estimator} | {', '.join(found)} |", flush=True)


def _cases(asked: study.Study, overrides: list[str], most: int | None) -> Iterator[tuple[list[str], Plan]]:
    for case in list(study.cases(asked, quick=False))[:most]:
        given = loading.load(asked.scenario, (*case.overrides, *overrides))
        if given.agents.estimator in _LINEAR:
            plan = making.make(given)
            if getattr(plan.law.build(), "source", None) != "communicated":  # then inputs are part of the state
                yield list(case.labels.values()), plan


def _phases(plan: Plan) -> list[phases.Phase]:
    return phases.phases(plan.swarm, plan.world.links, plan.faults)


def _rate(plan: Plan, graph: Graph) -> float:
    """Of the slowest mode."""
    largest = np.abs(np.linalg.eigvals(_step(plan, graph))).max()
    rate = float(np.log(largest)) / plan.world.dt
    return 0.0 if abs(rate) < _NOTHING else rate


def _step(plan: Plan, graph: Graph) -> Array:
    """One tick on one axis, by its response to each unit of the state, less what it does to none."""
    steered, present = np.flatnonzero(graph.steered), np.flatnonzero(graph.present)
    agents, followers = len(graph.steered), len(steered)
    size = 2 * followers + 2 * len(present)
    unit = np.concatenate([np.eye(size), np.zeros((1, size))])
    position, total, theta = (np.zeros((size + 1, agents, *shape)) for shape in ((2,), (2,), (2, 2)))
    position[:, steered, 0], total[:, steered, 0] = np.split(unit[:, : 2 * followers], 2, axis=1)
    theta[:, present, 0] = unit[:, 2 * followers :].reshape(size + 1, -1, 2)
    position, total, theta = _tick(plan, graph, position, total, theta)
    after = np.concatenate(
        [position[:, steered, 0], total[:, steered, 0], theta[:, present, 0].reshape(size + 1, -1)], axis=1
    )
    matrix: Array = (after[:-1] - after[-1]).T
    return matrix


def _tick(plan: Plan, graph: Graph, position: Array, total: Array, theta: Array) -> tuple[Array, Array, Array]:
    """Positions (S, N, D), sums of the law and consensus maps (S, N, D, D), a tick later."""
    brief, links, estimator, law = plan.brief, plan.world.links, plan.estimator.build(), plan.law.build()
    batch = position.shape[:2]
    seen = np.broadcast_to(graph.measured[links.slots] & links.present, (*batch, links.slots.shape[1]))
    relative = np.where(seen[..., None], position[:, :, None] - position[:, links.neighbours], 0.0)
    state, remembered = estimator.init(brief, batch), law.init(brief, batch)
    if isinstance(state, Agreement):
        began = np.ones(batch, dtype=bool)
        state = state._replace(consensus=state.consensus._replace(theta=theta, feasible=began))
    if isinstance(remembered, Integral):
        remembered = Integral(total)
    state, said = estimator.sense(brief, state, relative, seen)
    heard = {
        name: Heard({key: told[:, links.neighbours] for key, told in of.items()}, seen) for name, of in said.items()
    }
    still = np.zeros_like(position)
    own, nobody = Own(still, still), Heard({"velocity": np.zeros_like(relative)}, seen)
    state, estimate = estimator.fuse(brief, state, heard, own)
    remembered, command = law.command(brief, remembered, 0, own, estimate, nobody)
    return (
        position + plan.world.dt * command,
        remembered.force if isinstance(remembered, Integral) else still,
        state.consensus.theta if isinstance(state, Agreement) else np.zeros_like(theta),
    )


if __name__ == "__main__":
    main()
