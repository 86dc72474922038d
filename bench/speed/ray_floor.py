"""The floor by Ray actors: the hub and every agent are one, the driver is the world (`floors.py` starts this).

The same bytes come and go as between processes that send messages; answers of actors take the place of their messages back,
and the acts reach the world by the hub's answer, which spares each agent a message of its own.
"""

from __future__ import annotations

import json
import logging
import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

import ray

_CHANNELS = 3
_STORE = 80_000_000  # bytes, the least that Ray takes


class Agent:
    """Answers."""

    def __init__(self, size: Mapping[str, int]) -> None:
        self._size = size

    def sense(self, seen: bytes) -> list[bytes]:  # noqa: ARG002
        """Its broadcasts."""
        return [b"." * self._size["said"] for _ in range(_CHANNELS)]

    def act(self, heard: bytes) -> bytes:  # noqa: ARG002
        """Its act."""
        return b"." * self._size["act"]


class Hub:
    """Relays as the medium does."""

    def __init__(self, agents: Sequence[Any], size: Mapping[str, int]) -> None:
        self._agents, self._size = agents, size

    def tick(self, sense: bytes) -> tuple[bytes, list[bytes]]:  # noqa: ARG002
        """The journal, and all acts."""
        ray.get([agent.sense.remote(b"." * self._size["seen"]) for agent in self._agents])
        acts = ray.get([agent.act.remote(b"." * self._size["heard"]) for agent in self._agents])
        return b"." * self._size["journal"], acts


def main() -> None:
    """Fly; prints the seconds of a tick."""
    told = json.loads(sys.stdin.readline())
    agents, ticks, size = told["agents"], told["ticks"], told["size"]
    ray.init(
        num_cpus=agents + 1,
        include_dashboard=False,
        logging_level=logging.ERROR,
        log_to_driver=False,
        object_store_memory=_STORE,
    )
    flown = [ray.remote(Agent).remote(size) for _ in range(agents)]
    hub = ray.remote(Hub).remote(flown, size)
    ray.get(hub.tick.remote(b"." * size["sense"]))  # all are there
    print("ready", flush=True)
    began = time.perf_counter()
    for _ in range(ticks):
        ray.get(hub.tick.remote(b"." * size["sense"]))
    print((time.perf_counter() - began) / ticks, flush=True)
    sys.stdin.readline()
    ray.shutdown()


if __name__ == "__main__":
    main()
