"""What a filter remembers of the last ticks, so that it can fly them again when an input of one of them is heard late.

An input that comes late belongs to the tick in which it was flown. Whoever takes it for that of now, or carries each on by a
model and counts it as news, is too sure: inputs heard a hundred ticks late, one after the other, share nearly all that drove
them since. So the filter goes back to that tick, and takes in everything again. It then believes what it would have believed
had that input been heard in time, and the later ones not yet.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from agents.exchange import Heard
from analysis.models.arrays import Array, Integers, Mask, chosen

T = TypeVar("T", bound=tuple[Any, ...])


class TakenIn(NamedTuple):
    """What an agent took in in a tick, or in each of many, with an axis for them after the batch's.

    Parameters
    ----------
    own
        Its own input from the tick before, shape (..., D), in metres per second.
    measured, seen
        The edges, shape (..., n, D), and which were measured, shape (..., n).
    inputs, known
        The neighbours' inputs from the tick before, shape (..., n, D), in metres per second, and which it knows, (..., n).
    """

    own: Array
    measured: Array
    seen: Mask
    inputs: Array
    known: Mask


class RecentTicks(NamedTuple, Generic[T]):
    """The last ticks, newest first, along an axis after the batch's.

    Parameters
    ----------
    before
        What was believed before each.
    ticks
        What was taken in in each.
    lived
        How many of them there were, shape (...): beyond, nothing is remembered.
    """

    before: T
    ticks: TakenIn
    lived: Integers


def refuse_forgetful(memory: int) -> None:
    """Refuse a memory of less than nothing.

    Raises
    ------
    ValueError
        When it is negative.
    """
    if memory < 0:
        raise ValueError(f"memory counts ticks, from 0; got {memory}")


def blank(before: T, batch: tuple[int, ...], edges: tuple[int, int], memory: int) -> RecentTicks[T]:
    """Nothing remembered of the newest tick and of so many before it.

    Parameters
    ----------
    before
        What is believed at the beginning, with axes `batch`.
    batch
        Leading axes.
    edges
        How many edges an agent has, and in how many dimensions.
    memory
        In ticks.
    """
    kept, axis = (*batch, memory + 1), len(batch)
    nothing, no = np.zeros((*kept, *edges)), np.zeros((*kept, edges[0]), dtype=bool)
    own = np.zeros((*kept, edges[1]))
    repeated = _each(lambda array: np.repeat(np.expand_dims(array, axis), memory + 1, axis), before)
    return RecentTicks(repeated, TakenIn(own, nothing, no, nothing, no), np.zeros(batch, dtype=np.int64))


def advanced(recent: RecentTicks[T], before: T, own: Array, measured: Array, seen: Mask) -> RecentTicks[T]:
    """The ticks a tick later: with what is believed before it and taken in in it; of inputs nothing is known yet."""
    axis = seen.ndim - 1
    own = np.broadcast_to(own, (*measured.shape[:-2], measured.shape[-1]))
    newest = TakenIn(own, measured, seen, np.zeros_like(measured), np.zeros_like(seen))

    def pushed(new: Array, past: Array) -> Array:
        if past.shape[axis] == 1:
            return np.expand_dims(new, axis)
        kept = past[(slice(None),) * axis + (slice(0, past.shape[axis] - 1),)]
        return np.concatenate([np.expand_dims(new, axis), kept], axis=axis)

    lived = np.minimum(recent.lived + 1, recent.ticks.seen.shape[axis])
    return RecentTicks(_each(pushed, before, recent.before), _each(pushed, newest, recent.ticks), lived)


def filled_in(recent: RecentTicks[T], said: Heard) -> tuple[RecentTicks[T], Integers]:
    """The ticks with the inputs that were heard, each where it belongs, and how many ticks ago news begins, shape (...).

    What is older than all of them is lost, and what is known stays as it was heard first.

    Parameters
    ----------
    recent
        Of this tick.
    said
        What arrived on the channel of inputs.
    """
    ticks = recent.ticks
    ago = np.arange(ticks.known.shape[-2])[:, None]
    remembered = ago < recent.lived[..., None, None]
    arrived = said.fresh[..., None, :] & (np.broadcast_to(said.age, said.fresh.shape)[..., None, :] == ago) & remembered
    news = arrived & ~ticks.known
    inputs = np.where(news[..., None], said.fields["velocity"][..., None, :, :], ticks.inputs)
    oldest = (ago * news).max(axis=(-2, -1), initial=0)
    return recent._replace(ticks=ticks._replace(inputs=inputs, known=ticks.known | arrived)), oldest


def reprocessed(
    recent: RecentTicks[T], oldest: Integers, step: Callable[[T, TakenIn], tuple[T, Array]]
) -> tuple[T, RecentTicks[T], Array]:
    """What is believed now, the ticks with what was believed before each, and the innovations of this one.

    Parameters
    ----------
    recent
        With all that was heard.
    oldest
        How many ticks ago there is news, shape (...); who has none so old keeps what it believed.
    step
        What a tick makes of a belief, and its innovations.
    """
    axis = recent.ticks.seen.ndim - 2
    first = int(oldest.max(initial=0))
    believed = _at(recent.before, first, axis)
    after: list[T] = []
    innovation = np.zeros(0)
    for ago in range(first, -1, -1):
        believed, innovation = step(believed, _at(recent.ticks, ago, axis))
        if ago:
            believed = chosen(oldest >= ago, believed, _at(recent.before, ago - 1, axis))
        after.insert(0, believed)
    if not first:
        return believed, recent, innovation

    def renewed(old: Array, *new: Array) -> Array:
        untouched = old[(slice(None),) * axis + (slice(first, None),)]
        return np.concatenate([np.stack(new, axis=axis), untouched], axis=axis)

    return believed, recent._replace(before=_each(renewed, recent.before, *after[1:])), innovation


def unheard(
    recent: RecentTicks[T], before: T, own: Array, step: Callable[[T, TakenIn], tuple[T, Array]]
) -> tuple[T, RecentTicks[T]]:
    """What is believed after a tick in which nothing was measured and nothing heard, and the ticks with it."""
    quiet = _at(recent.ticks, 0, recent.ticks.seen.ndim - 2)
    passed = advanced(recent, before, own, np.zeros_like(quiet.measured), np.zeros_like(quiet.seen))
    believed, passed, _ = reprocessed(passed, np.zeros_like(passed.lived), step)
    return believed, passed


def _at(many: T, ago: int, axis: int) -> T:
    return _each(lambda array: array[(slice(None),) * axis + (ago,)], many)


def _each(make: Callable[..., Array], first: Any, *others: Any) -> Any:
    """Nested tuples of what is made of the arrays that stand in the same place in all of them."""
    if isinstance(first, tuple):
        return type(first)(*(_each(make, *same) for same in zip(first, *others, strict=True)))
    return make(first, *others)
