"""The realised graph is the same, however many ticks at a time it is followed."""

from dataclasses import fields

import numpy as np
import pytest

from netem.core.links import Links
from netem.faults.timeline import Timeline
from world.books.realised import GraphWatch, realise
from world.formation.nominal import PRESETS

ZHAO7 = PRESETS["zhao7"]
LINKS = Links.both_ways(ZHAO7.agents, ZHAO7.edges)
TIMELINE = Timeline(LINKS, ())
TICKS, DT = 30, 0.1


def arrivals():
    """What arrives in which tick, with contents that come late and overtake each other, shape (TICKS, 2, L)."""
    rng = np.random.default_rng(1)
    sent = np.arange(TICKS)[:, None, None] - rng.integers(0, 9, size=(TICKS, 2, len(LINKS)))
    return np.where((sent >= 0) & (rng.random(sent.shape) < 0.15), sent, -1).astype(np.int32)


@pytest.mark.parametrize("window", [1, 2, 5, 40])
@pytest.mark.parametrize("batch", [1, 2, 7])
def test_in_batches_it_is_that_of_the_whole_run(window, batch):
    newest = arrivals()
    watch = GraphWatch(ZHAO7, LINKS, DT, window)
    parts = [watch.follow(first, newest[first : first + batch], TIMELINE) for first in range(0, TICKS, batch)]
    whole = realise(newest, ZHAO7, TIMELINE, DT, window)
    for field in fields(whole):
        together = np.concatenate([getattr(part, field.name) for part in parts])
        np.testing.assert_array_equal(together, getattr(whole, field.name), field.name)


def test_what_came_before_the_window_still_has_its_age():
    newest = np.full((TICKS, 1, len(LINKS)), -1, dtype=np.int32)
    newest[3, 0, 0], newest[8, 0, 0] = 3, 1  # what comes later is older
    watch = GraphWatch(ZHAO7, LINKS, DT, 2)
    parts = [watch.follow(first, newest[first : first + 5], TIMELINE) for first in range(0, TICKS, 5)]
    ages = np.concatenate([part.age_s[:, 0, 0] for part in parts])
    assert np.isnan(ages[:3]).all()
    np.testing.assert_allclose(ages[3:], np.arange(TICKS - 3) * DT)
