"""Pathloss events of EMANE's event log, EEL: `1.0 nem:1 pathloss nem:2,90.5 nem:3,110,112`."""

from __future__ import annotations

import re

from affinet.traces.fields import LARGEST_DB, LATEST, moment, number
from affinet.traces.link_data import LinkData, Quantity, once_each, steps
from netem.impairments.measured import Lines, MeasuredError, shown

_MODULE = re.compile(r"nem:(\d{1,18})")


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    return any(len(words := text.split()) > 2 and _MODULE.fullmatch(words[1]) for text in lines.texts[:200])


def read(lines: Lines) -> LinkData:
    """What events say of pathloss; those of other kinds are left out.

    Raises
    ------
    MeasuredError
        When they are none.
    """
    nodes: dict[str, int] = {}
    rows, others, ends = [], set[str](), 0.0
    for line, text in zip(*lines, strict=True):
        words = text.partition("#")[0].split()
        if len(words) < 3:
            raise MeasuredError(f"line {line}: 'TIME nem:N pathloss nem:M,dB' is due, got {shown(text)}")
        time = max(0.0, moment(line, words[0], least=-LATEST))  # what is before 0 holds from it
        sender = _module(line, words[1])
        ends = max(ends, time)
        if words[2] != "pathloss":
            others.add(words[2])
            continue
        if len(words) < 4:
            raise MeasuredError(f"line {line}: nobody is told the pathloss of nem:{sender}: add nem:M,dB")
        one = nodes.setdefault(sender, len(nodes))
        for word in words[3:]:
            name, *losses = word.split(",")
            if len(losses) not in (1, 2):
                raise MeasuredError(f"line {line}: nem:M,dB or nem:M,dB,dB back is due, got {shown(word)}")
            receiver = _module(line, name)
            if receiver == sender:
                raise MeasuredError(f"line {line}: nem:{sender} has a pathloss to itself: name another")
            other = nodes.setdefault(receiver, len(nodes))
            there, back = (_pathloss(line, loss) for loss in (losses[0], losses[-1]))
            rows += [(line, time, one, other, there), (line, time, other, one, back)]
    if not rows:
        raise MeasuredError("line 1: no event of pathloss in it: locations and others say nothing of losses")
    assumed = [
        "before its first pathloss a link is down, as in EMANE",
        "without a word on the way back, the pathloss is that of the way there",
    ]
    if others:
        assumed.append(f"events of {', '.join(sorted(others))} are left out")
    return LinkData(
        tuple(nodes),
        ends,
        {Quantity.PATHLOSS: once_each(steps(rows), tuple(nodes))},
        everybody=True,
        assumed=tuple(assumed),
    )


def _module(line: int, text: str) -> str:
    if (module := _MODULE.fullmatch(text)) is None:
        raise MeasuredError(f"line {line}: an NEM is due, like nem:3, got {shown(text)}")
    return str(int(module[1]))


def _pathloss(line: int, text: str) -> float:
    return number(line, text, "a pathloss in dB", least=-LARGEST_DB, most=LARGEST_DB)
