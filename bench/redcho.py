"""REDCHO by Euler steps down to the microsecond of paper 002, on what the agents of scenario `target` know in a flight.

    python bench/redcho.py [--steps 1e-3,1e-4,1e-5,1e-6] [--thetas 8,16,40] [--seconds 2] [--seed 1]

Prints how far the position, velocity and acceleration that agents agree on are from those of the mean of what they know (8):
root mean squares over agents, axes and time, from the first second on. The air is perfect, and as fast as the steps: what is
left is the protocol's own error. Between the ticks of the flight, of a millisecond, information follows its derivatives.
"""

from __future__ import annotations

import argparse

import numpy as np

from affinet.planning import making
from affinet.scenario import loading
from affinet.studies.batch import fly_all
from agents.algebra.redcho import Consensus
from agents.estimators.target import TargetEstimator
from analysis.models.arrays import Array, Integers
from analysis.models.information import position_jet, unpacked
from world.physics.bodies import carried

_TICK = 1e-3  # s
_AXES = 2
_WHOLE = 1e-6
_SETTLED = 1.0  # s


def main() -> None:
    """Fly once, and agree by every step and gain."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=_numbers, default=[1e-3, 1e-4, 1e-5, 1e-6], help="in seconds")
    parser.add_argument("--thetas", type=_numbers, default=[8.0, 16.0, 40.0])
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if not all(0.0 < step <= _TICK and abs(_TICK / step - round(_TICK / step)) < _WHOLE for step in options.steps):
        parser.error(f"steps are at most {_TICK:g} s, the tick of the flight, and divide it")
    if options.seconds <= _SETTLED:
        parser.error(f"errors count from {_SETTLED:g} s on: give more seconds than that")
    known, neighbours = _flown(options.seconds, options.seed)
    print("| step (s) | theta | position (m) | velocity (m/s) | acceleration (m/s2) |")
    print("|---|---|---|---|---|")
    for step in options.steps:
        for theta in options.thetas:
            errors = _agree(known, neighbours, step, theta)
            print(f"| {step:g} | {theta:g} | {' | '.join(f'{error:.2g}' for error in errors)} |", flush=True)


def _numbers(text: str) -> list[float]:
    return [float(number) for number in text.split(",")]


def _flown(seconds: float, seed: int) -> tuple[Array, Integers]:
    """What every agent knows in every tick, with derivatives, shape (T, m + 1, N, C), and its neighbours (N, n)."""
    overrides = (f"time.dt={_TICK}", f"time.duration={seconds}", 'agents.parameters.target.fusion="none"')
    flown = making.make(loading.load("target", overrides))
    (known,) = [fly_all(flown, [seed], 1).first["information"]]
    return np.moveaxis(known, 1, 2), flown.world.links.neighbours


def _agree(known: Array, neighbours: Integers, step: float, theta: float) -> Array:
    """Root mean square errors of position, velocity and acceleration, shape (m + 1,)."""
    defaults = TargetEstimator()
    order, agents, numbers = known.shape[1] - 1, *known.shape[2:]
    consensus = Consensus(order, theta, tuple(defaults.k), tuple(defaults.gamma))
    internal, steps = np.zeros((agents, order + 1, numbers)), round(_TICK / step)
    off = []
    with np.errstate(over="ignore", invalid="ignore"):  # steps that are too long for the gain
        for now, jet in enumerate(known):
            agreed = consensus.outputs(jet, internal)
            if now * _TICK >= _SETTLED:
                off.append(_positions(agreed) - _positions(jet.mean(axis=1, keepdims=True)))
            for within in range(steps):
                seconds = within * step
                own = consensus.outputs(np.concatenate([carried([*jet], seconds)[None], jet[1:]]), internal)[0]
                internal = consensus.step(internal, own, own[neighbours], step)
        return np.asarray(np.sqrt(np.square(off).mean(axis=(0, 2, 3))))


def _positions(information: Array) -> Array:
    return position_jet(*unpacked(information, _AXES, len(information) - 1))


if __name__ == "__main__":
    main()
