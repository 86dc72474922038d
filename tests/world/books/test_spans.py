"""Ticks put together to whole spans, however many come at a time."""

import numpy as np
import pytest
from flying import plan_of

from affinet.runtimes.inprocess import InProcessSwarm
from world.books.spans import Spans, joined

PLAN = plan_of("localization", "time.duration=0.2")


def flown(batch):
    moments = []
    InProcessSwarm(PLAN).fly(lambda now, _: moments.append(now), batch)
    return moments


@pytest.mark.parametrize(("batch", "ticks"), [(3, 5), (5, 5), (10, 5), (7, 1), (4, 100), (1, 20)])
def test_whole_spans_come_as_soon_as_they_are_there_and_the_rest_in_the_end(batch, ticks):
    spans, known, found = Spans(ticks), 0, []
    for moments in flown(batch):
        known += len(moments.error)
        if (whole := spans.whole(moments)) is not None:
            found.append(whole)
            assert len(whole.error) % ticks == 0
        assert known - sum(len(one.error) for one in found) < ticks
    rest = spans.rest()
    assert spans.rest() is None
    everything, (direct,) = joined([*found, *([] if rest is None else [rest])]), flown(20)
    assert [one.first for one in found] == np.cumsum([0, *(len(one.error) for one in found)])[:-1].tolist()
    assert everything.first == 0
    np.testing.assert_array_equal(everything.ticks, range(20))
    for name in ("position", "verdicts", "newest", "error"):
        np.testing.assert_array_equal(getattr(everything, name), getattr(direct, name))
    assert everything.reports.keys() == direct.reports.keys()
    for name, said in direct.reports.items():
        np.testing.assert_array_equal(everything.reports[name], said)
