"""A packet-delivery trace of Mahimahi's mm-link: when 1500 bytes may pass, in milliseconds, one a line."""

from __future__ import annotations

import numpy as np

from affinet.traces.link_data import LinkData, Quantity, Steps
from netem.impairments.measured import Lines, MeasuredError, shown

_BITS = 8 * 1500
_MS = 1e-3
_SOON = 1000  # ms


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    return bool(lines.texts) and all(text.strip().isdecimal() for text in lines.texts[:200])


def read(lines: Lines) -> LinkData:
    """What a trace says.

    Raises
    ------
    MeasuredError
        When it is none.
    """
    for line, text in zip(*lines, strict=True):
        if not text.strip().isdecimal() or len(text.strip()) > 12:
            raise MeasuredError(f"line {line}: a whole number of milliseconds is due, got {shown(text)}")
    at = np.array([int(text) for text in lines.texts], dtype=np.int64)
    if not len(at) or not at[-1]:
        raise MeasuredError("line 1: the trace must last for longer than 0 ms: its last line is when it begins anew")
    for place in np.flatnonzero(np.diff(at) < 0)[:1]:
        raise MeasuredError(
            f"line {lines.numbers[place + 1]}: {at[place + 1]} ms comes after {at[place]} ms: sort the lines"
        )
    # what may pass at k ms fills the millisecond up to it, so that all of a period lies within it
    cell, packets = np.unique(np.maximum(at - 1, 0), return_counts=True)
    begins = np.unique(np.concatenate([[0], cell, cell + 1]))
    begins = begins[begins < at[-1]]
    value = np.zeros(len(begins))
    value[np.searchsorted(begins, cell)] = packets * _BITS / _MS
    assumed = ["it says of one way when 1500 bytes may pass, nothing of losses or delays; at its end it begins anew"]
    if at[0] > _SOON:
        assumed.append(
            f"nothing passes in its first {at[0] * _MS:g} s: if its beginning is missing, take that off all lines"
        )
    nowhere = np.zeros(len(begins), dtype=np.int64)
    return LinkData(
        nodes=("here", "there"),
        ends=float(at[-1]) * _MS,
        steps={Quantity.RATE: Steps(nowhere, begins * _MS, nowhere, nowhere + 1, value)},
        one_link=True,
        period=float(at[-1]) * _MS,
        assumed=tuple(assumed),
    )
