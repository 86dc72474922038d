"""The colours of recordings and pictures: what an agent is and does, and what became of a message."""

from __future__ import annotations

from netem.medium.verdict import Verdict

LEADER, FOLLOWER = 0xF2B705FF, 0x3FA7F5FF
DEAD, PAUSED, DEPARTED, VANISHED = 0xB23B3BFF, 0xB388FFFF, 0x8A8A8AFF, 0x00000000
SENSING, COMMS, BOTH = 0x3DDC84FF, 0x3FA7F5FF, 0x8FE3FFFF
PLAIN, FAINT, BAND = 0x9AA5B1FF, 0x8888AA60, 0x909090FF  # viewers may have a dark ground or a light one
# Each can be told from a white ground, and from a black one.
OF_VERDICT = {
    Verdict.SILENT: 0x00000000,
    Verdict.DELIVERED: 0x3DDC84FF,
    Verdict.DELAYED: 0x86C2F7FF,
    Verdict.DEAD: 0xB23B3BFF,
    Verdict.PAUSED: 0xB388FFFF,
    Verdict.DEPARTED: 0x8A8A8AFF,
    Verdict.CUT: 0xFF3B30FF,
    Verdict.PARTITION: 0xC86BFFFF,
    Verdict.SCRIPTED: 0xFF6B6BFF,
    Verdict.DROPOUT: 0xFF80ABFF,
    Verdict.CLOSED: 0x6A6A7AFF,
    Verdict.RANGE: 0xA1887FFF,
    Verdict.JAMMED: 0xB59B00FF,
    Verdict.LISTED: 0xDDA15EFF,
    Verdict.LOST: 0xFF9F1CFF,
    Verdict.OVERFLOW: 0x26C6DAFF,
    Verdict.UNSAID: 0xF48FB1FF,
}
WALL, JAMMED, RANGE = 0xB0A090FF, 0xFFEB3B55, 0x6A6A8A30
# As far from each other as so many can be on either ground.
_OF_AGENTS = (
    *(0x3D9BE9FF, 0xF59E0BFF, 0x3FAE5AFF, 0xE5484DFF, 0xA45EE5FF, 0xB8A100FF),
    *(0x9C6B4FFF, 0xEC6FB0FF, 0x17A398FF, 0x8DAA3AFF, 0x7783D6FF, 0x8E97A3FF),
)
MOST_APART = len(_OF_AGENTS)


def css(colour: int) -> str:
    """A colour as pages and pictures say it, without how much shows through."""
    return f"#{colour >> 8:06x}"


def of_agents(number: int) -> list[int]:
    """A colour for each of so many agents, which differ up to `MOST_APART` of them."""
    return [_OF_AGENTS[agent % MOST_APART] for agent in range(number)]
