"""Who should lead a large formation, and what shares of its cliques bring: docs/decisions/0025.

    python bench/leaders.py            # the tables of the decision; a quarter of an hour
    python bench/leaders.py --swarms swarm50

Seconds to 1/e under the static law at its usual gain, of stresses with a largest eigenvalue of 1.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence

import numpy as np
from scipy import sparse

from agents.laws.single import Static
from analysis.models.arrays import Array
from world.formation import composed, spectrum, stress, swarms
from world.formation.leading import corners
from world.formation.nominal import Formation

_CHANCES, _SWEEPS, _FEW = 10, 2, 100
Chosen = list[int]


def settles(L: sparse.csr_array, leaders: Sequence[int]) -> float:
    """Seconds to 1/e behind leaders in these rows."""
    return 1.0 / (Static().alpha * max(_slowest(L, leaders)[0], 1e-15))


def _slowest(L: sparse.csr_array, leaders: Sequence[int]) -> tuple[float, Array, Array]:
    followers = np.setdiff1d(np.arange(L.shape[0]), leaders)
    smallest, mode = spectrum.slowest(L[followers][:, followers], 1.0)
    return smallest, mode, followers


def _moves_most(L: sparse.csr_array, leaders: Chosen) -> int:
    _, mode, followers = _slowest(L, leaders)
    return int(followers[np.argmax(np.abs(mode))])


def by_mode(L: sparse.csr_array, nominal: Array, number: int) -> Chosen:
    """Corners, then who moves most in the slowest mode: what `affinet design` does."""
    found = corners(nominal)
    while len(found) < number:
        found.append(_moves_most(L, found))
    return found


def farthest(L: sparse.csr_array, nominal: Array, number: int) -> Chosen:  # noqa: ARG001
    """Corners, then who is farthest from all leaders."""
    return _spread(nominal, np.arange(len(nominal)), number)


def on_the_rim(L: sparse.csr_array, nominal: Array, number: int) -> Chosen:  # noqa: ARG001
    """The same, among the outermost."""
    out = np.linalg.norm(nominal - nominal.mean(axis=0), axis=1)
    return _spread(nominal, np.argsort(-out, kind="stable")[: 3 * number], number)


def _spread(nominal: Array, among: Array, number: int) -> Chosen:
    found = corners(nominal)
    while len(found) < number:
        near = np.linalg.norm(nominal[among][:, None] - nominal[found], axis=-1).min(axis=1)
        found.append(int(among[np.argmax(near)]))
    return found


def best_each(L: sparse.csr_array, nominal: Array, number: int) -> Chosen:
    """Corners, then whoever makes it fastest, each tried."""
    found = corners(nominal)
    while len(found) < number:
        others = np.setdiff1d(np.arange(len(nominal)), found)
        found.append(int(others[np.argmin([settles(L, [*found, int(other)]) for other in others])]))
    return found


def swapped(L: sparse.csr_array, nominal: Array, number: int) -> Chosen:
    """Those by mode, each of which then leaves for who moves most without it, where that is faster."""
    found = by_mode(L, nominal, number)
    for _ in range(_SWEEPS):
        for leader in tuple(found):
            rest = [other for other in found if other != leader]
            other = [*rest, _moves_most(L, rest)]
            if settles(L, other) < settles(L, found):
                found = other
    return found


WAYS: dict[str, Callable[[sparse.csr_array, Array, int], Chosen]] = {
    "slowest mode": by_mode,
    "farthest": farthest,
    "rim": on_the_rim,
    "swapped": swapped,
    "each tried": best_each,
}


def stress_of(formation: Formation, rounds: int) -> sparse.csr_array:
    """The sum of the stresses of the cliques after so many rounds of evening out, with a largest eigenvalue of 1."""
    L = composed.summed(formation, rounds)
    return sparse.csr_array(L / spectrum.largest(L))


def _row(name: str) -> str:
    formation = swarms.preset(name)
    number, L = len(formation.leaders), stress_of(formation, composed.ROUNDS)
    cells = [
        f"{settles(L, way(L, formation.nominal, number)):.1f}"
        if way is not best_each or formation.agents <= _FEW
        else ""
        for way in WAYS.values()
    ]
    rng = np.random.default_rng(1)
    chance = [settles(L, rng.permutation(formation.agents)[:number].tolist()) for _ in range(_CHANCES)]
    return f"| {name} | {number} | {' | '.join(cells)} | {np.median(chance):.0f} |"


def _shares(name: str) -> str:
    formation = swarms.preset(name)
    leaders = [leader - 1 for leader in formation.leaders]
    cells = [f"{settles(stress_of(formation, rounds), leaders):.1f}" for rounds in (0, 1, 2, 3, 6, 12)]
    return f"| {name} | {' | '.join(cells)} |"


def _program(name: str) -> str:
    formation = swarms.preset(name)
    times, cells = [], []
    for weigh in (lambda: composed.compose(formation), lambda: stress._programmed(formation)[0]):
        begun = time.perf_counter()
        weights = weigh()
        times.append(time.perf_counter() - begun)
        L = sparse.csr_array(stress.laplacian(formation, weights))
        cells.append(f"{settles(L / spectrum.largest(L), [leader - 1 for leader in formation.leaders]):.1f}")
    return f"| {name} | {times[0]:.2f} | {times[1]:.2f} | {cells[0]} | {cells[1]} |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="Leaders of large formations, and shares of their cliques.")
    parser.add_argument("--swarms", nargs="+", choices=swarms.SWARMS, default=[*swarms.SWARMS])
    parser.add_argument("--program", action="store_true", help="also the semidefinite program, up to 50 agents")
    parsed = parser.parse_args()
    print(f"| formation | leaders | {' | '.join(WAYS)} | by chance |\n|---|---|{'---|' * (len(WAYS) + 1)}")
    for name in parsed.swarms:
        print(_row(name), flush=True)
    print("\n| rounds of evening out | 0 | 1 | 2 | 3 | 6 | 12 |\n|---|---|---|---|---|---|---|")
    for name in parsed.swarms:
        print(_shares(name), flush=True)
    if parsed.program:
        print("\n| formation | cliques, s | program, s | settles by cliques | by the program |\n|---|---|---|---|---|")
        for name in parsed.swarms:
            if swarms.SWARMS[name].agents <= _FEW // 2:
                print(_program(name), flush=True)


if __name__ == "__main__":
    main()
