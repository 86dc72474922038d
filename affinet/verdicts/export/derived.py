"""The arrays of a run, with those that are made of them when they are asked for: the age of news."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from affinet.verdicts.evidence import Evidence
from analysis.models import graph
from analysis.models.arrays import Array
from world.books.described import AGE_OF_NEWS
from world.books.history import Arrays, by_span


def whole(run: Evidence) -> Arrays:
    """All arrays of a run, and how old the news of each link is, shape (T, C, L), in seconds; NaN before any has come."""
    return {**run.arrays, AGE_OF_NEWS: _age(run, _nothing(run), run.arrays["newest"], 0)}


def by_parts(run: Evidence) -> Iterator[Arrays]:
    """The same, of so many ticks at a time as `world.books.history.by_span` takes."""
    before, first = _nothing(run), 0
    for span in by_span(run.arrays):
        yield {**span, AGE_OF_NEWS: _age(run, before, span["newest"], first)}
        before = np.concatenate([before, span["newest"]]).max(axis=0, keepdims=True)
        first += len(span["newest"])


def _nothing(run: Evidence) -> NDArray[np.int32]:
    return np.full((1, *run.arrays["newest"].shape[1:]), -1, dtype=np.int32)


def _age(run: Evidence, before: NDArray[np.int32], newest: NDArray[np.int32], first: int) -> Array:
    """In ticks that follow each other, of which this is the first; `before` is the newest that had come until then."""
    known = np.concatenate([before, newest])
    age = graph.age(known.reshape(len(known), -1), np.arange(first - 1, first + len(newest)))
    seconds: Array = age[1:].reshape(newest.shape) * run.dt
    return seconds
