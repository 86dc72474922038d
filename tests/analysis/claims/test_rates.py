"""How often checks hold what is false, and fail what is true: docs/accuracy.md has the table of more draws."""

import pytest
from planted import PLANTED, rates

DRAWS = 60


@pytest.mark.parametrize("planted", PLANTED, ids=lambda one: one.name)
def test_what_is_true_is_not_failed_and_what_is_false_does_not_hold(planted):
    inside, edge, outside = (rates(planted, by, DRAWS) for by in (planted.margin, -1e-9, -planted.margin))
    assert inside.fails == outside.holds == 0
    assert inside.holds > DRAWS / 4 < outside.fails
    # At the very edge nearly all is undecided.
    assert edge.holds + edge.fails <= DRAWS / 10
