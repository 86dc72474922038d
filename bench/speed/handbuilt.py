"""One process of a swarm as it is built by hand: ZeroMQ, and filterpy in every agent (`handbuilt_swarm.py` starts these).

The world has the lossy medium in it, and knows what each agent flies: so it hands every agent what it measures and hears in
one message, and one answer comes back, where affinet takes two exchanges. It knows nothing of affinet but the draws, and those
only where both are to compute the same.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import zmq


def be_world(told: Mapping[str, Any], socket: zmq.Context) -> None:
    """Move, measure, lose, and wait for everybody; prints the seconds of a tick."""
    src, dst = np.array(told["src"]), np.array(told["dst"])
    target, dt, sigma, loss = np.array(told["target"]), told["dt"], told["sigma"], told["loss"]
    agents, links, ticks = target.shape[1], len(src), len(target) - 1
    answers = socket.socket(zmq.PULL)
    answers.bind(f"ipc://{told['folder']}/answers")
    inboxes = [socket.socket(zmq.PUSH) for _ in range(agents)]
    for agent, inbox in enumerate(inboxes):
        inbox.connect(f"ipc://{told['folder']}/{agent}")
    draws = _Drawn(told["seed"], src, dst) if told["as_affinet"] else _Generated()
    ready()
    leader = np.array(told["leader"])[:, None]
    position = target[0] + np.where(leader, 0.0, told["spread"] * draws.start(agents))
    velocity = np.zeros((agents, 2))
    slots = [np.flatnonzero(dst == agent) for agent in range(agents)]
    kept: dict[str, Any] = {
        name: np.zeros((ticks, rows, *shape))
        for name, rows, shape in (
            ("position", agents, (2,)),
            ("input", agents, (2,)),
            ("measured", links, (2,)),
            ("seen", links, ()),
            ("estimate", links, (2,)),
            ("covariance", links, (2, 2)),
        )
    }
    began = time.perf_counter()
    for tick in range(ticks):
        noise, uniform = draws.tick(tick, links)
        measured, seen = position[dst] - position[src] + sigma * noise, uniform >= loss
        for agent, inbox in enumerate(inboxes):
            heard = np.flatnonzero(seen[slots[agent]])
            rows = slots[agent][heard]
            inbox.send(
                msgpack.packb(
                    {
                        "k": tick,
                        "slots": heard.tolist(),
                        "measured": measured[rows].tolist(),
                        "velocity": velocity[src[rows]].tolist(),
                        "position": position[agent].tolist(),
                    }
                )
            )
        for name, value in (("position", position), ("measured", measured), ("seen", seen)):
            kept[name][tick] = value
        for _ in range(agents):
            act = msgpack.unpackb(answers.recv())
            agent = act["agent"]
            kept["input"][tick, agent] = act["input"]
            kept["estimate"][tick, slots[agent]] = act["estimate"]
            kept["covariance"][tick, slots[agent]] = act["covariance"]
        velocity = kept["input"][tick].copy()
        position = position + dt * velocity
    np.savez(Path(told["folder"]) / "arrays.npz", **kept)
    print((time.perf_counter() - began) / ticks, flush=True)


def be_agent(told: Mapping[str, Any], socket: zmq.Context) -> None:
    """Filter every edge, and steer."""
    from filterpy.kalman import KalmanFilter

    inbox, answers = socket.socket(zmq.PULL), socket.socket(zmq.PUSH)
    inbox.bind(f"ipc://{told['folder']}/{told['agent']}")
    answers.connect(f"ipc://{told['folder']}/answers")
    stress, target = np.array(told["stress"]), np.array(told["target"])
    dt, alpha, degree = told["dt"], told["alpha"], told["degree"]
    filters = []
    for _ in stress:
        one = KalmanFilter(dim_x=6, dim_z=2)
        one.F, one.Q = np.kron(told["F"], np.eye(2)), np.kron(told["Q"], np.eye(2))
        one.H, one.R = np.eye(2, 6), told["sigma"] ** 2 * np.eye(2)
        one.P = np.diag(np.repeat(told["prior"], 2) ** 2)
        filters.append(one)
    known, theirs = np.zeros(len(filters), dtype=bool), np.zeros((len(filters), 2))
    ready()
    for tick in range(len(target) - 1):
        sensed = msgpack.unpackb(inbox.recv())
        for one in filters:
            one.predict()
        for slot, y, velocity in zip(sensed["slots"], sensed["measured"], sensed["velocity"], strict=True):
            filters[slot].update(np.array(y))
            known[slot], theirs[slot] = True, velocity
        estimate = np.array([one.x[:2, 0] for one in filters])
        if told["leads"]:
            pull = told["leader_gain"] * (target[tick] - sensed["position"])
            steered = (target[tick + 1] - target[tick]) / dt + pull
        else:
            pull = theirs - alpha * np.where(known[:, None], estimate, 0.0)
            steered = (stress[:, None] * pull).sum(axis=0) / degree
        act = {
            "agent": told["agent"],
            "input": steered.tolist(),
            "estimate": estimate.tolist(),
            "covariance": [one.P[:2, :2].tolist() for one in filters],
        }
        answers.send(msgpack.packb(act))


class _Generated:
    """Draws as most make them."""

    def __init__(self) -> None:
        self._rng = np.random.default_rng(1)

    def start(self, agents: int) -> Any:
        return self._rng.standard_normal((agents, 2))

    def tick(self, tick: int, links: int) -> tuple[Any, Any]:  # noqa: ARG002
        return self._rng.standard_normal((links, 2)), self._rng.random(links)


class _Drawn:
    """Those of affinet's run with this seed."""

    def __init__(self, seed: int, src: Any, dst: Any) -> None:
        from scipy.special import ndtri

        from netem.core.draws import Purpose, uniform

        self._ndtri, self._uniform, self._for = ndtri, uniform, Purpose
        self._seed, self._ends = seed, {"src": src + 1, "dst": dst + 1}

    def start(self, agents: int) -> Any:
        numbers = np.arange(1, agents + 1)
        return self._ndtri(self._uniform(self._seed, self._for.INITIAL_POSITION, src=numbers, lanes=2))

    def tick(self, tick: int, links: int) -> tuple[Any, Any]:  # noqa: ARG002
        noise = self._uniform(self._seed, self._for.SENSOR_NOISE, tick=tick, **self._ends, lanes=2)
        return self._ndtri(noise), self._uniform(self._seed, self._for.LOSS, tick=tick, **self._ends)[..., 0]


def ready() -> None:
    """Say so, and wait for the word to begin."""
    print("ready", flush=True)
    sys.stdin.readline()


def main() -> None:
    """Be the role that standard input names."""
    told = json.loads(sys.stdin.readline())
    context = zmq.Context()
    if told["role"] == "world":
        be_world(told, context)
    else:
        be_agent(told, context)
    sys.stdin.readline()
    context.destroy(linger=0)


if __name__ == "__main__":
    main()
