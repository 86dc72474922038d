"""Formations by name: the small ones of papers, and swarms on a lattice."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from world.formation.cliques import within
from world.formation.layouts import grid
from world.formation.nominal import PRESETS, Formation


@dataclass(frozen=True)
class Swarm:
    """Agents on the unit lattice, closest to its origin, who see each other within 2.25 m: two steps along, and one aside.

    Parameters
    ----------
    agents, dimension
        N and D.
    leaders
        As `affinet design grid --range 2.25 --settle 10` chooses them. On a lattice some move alike, and which of them comes
        first is a matter of last bits: so they stand here.
    """

    agents: int
    dimension: int
    leaders: tuple[int, ...]

    def formation(self) -> Formation:
        """Its nodes, edges and leaders; nothing in them depends on the machine."""
        nominal = grid(self.agents, self.dimension)
        return Formation(nominal, within(nominal, _RANGE), self.leaders)


_RANGE = 2.25  # m

# fmt: off
_OF_500 = (
    1, 34, 38, 63, 67, 89, 105, 126, 136, 146, 157, 162, 172, 227, 241, 258, 265, 277, 280, 283, 284, 286,
    313, 324, 345, 440, 442, 445, 446, 450, 452, 462, 472, 481, 487, 489, 490, 493, 495, 496, 499, 500,
)
_OF_500_IN_3D = (
    19, 39, 61, 63, 92, 140, 308, 317, 328, 360, 380, 381, 386, 389, 438, 443, 451, 463, 474, 478, 479, 492,
    494, 495, 496,
)
# fmt: on

SWARMS: dict[str, Swarm] = {
    "swarm50": Swarm(50, 2, (1, 39, 42, 45, 47, 48, 49, 50)),
    "swarm100": Swarm(100, 2, (1, 15, 18, 70, 75, 76, 80, 88, 98, 99, 100)),
    "swarm500": Swarm(500, 2, _OF_500),
    "swarm50-3d": Swarm(50, 3, (3, 27, 30, 34, 40, 41, 50)),
    "swarm100-3d": Swarm(100, 3, (6, 79, 86, 87, 91, 93, 95, 99, 100)),
    "swarm500-3d": Swarm(500, 3, _OF_500_IN_3D),
}

NAMES = (*PRESETS, *SWARMS)


@cache
def preset(name: str) -> Formation:
    """The formation of this name, one of `NAMES`."""
    return PRESETS[name] if name in PRESETS else SWARMS[name].formation()
