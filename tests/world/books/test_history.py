"""The digest of a run: equal for equal bits, and for nothing else."""

import numpy as np
import pytest

from world.books.history import digest

ARRAYS = {"error": np.zeros(6), "known": np.zeros((2, 3), dtype=np.int8)}


def test_the_order_of_names_and_the_layout_in_memory_do_not_matter():
    again = {"known": np.asfortranarray(ARRAYS["known"]), "error": np.zeros(12)[::2]}
    assert digest(again) == digest(ARRAYS)


@pytest.mark.parametrize(
    "other",
    [
        {"error": np.full(6, np.nextafter(0.0, 1.0))},
        {"error": -np.zeros(6)},
        {"error": np.zeros((2, 3))},
        {"error": np.zeros(6, dtype=np.int64)},
        {"known": np.zeros((2, 3), dtype=bool)},
        {"known": np.zeros((2, 3), dtype=np.uint8)},
        {"errors": np.zeros(6)},
    ],
    ids=["last bit", "sign of zero", "shape", "integers", "truths", "unsigned", "another name"],
)
def test_it_tells_apart(other):
    assert digest(ARRAYS | other) != digest(ARRAYS)


DROPPED = np.array([[0, 0, 0, 2], [0, 0, 0, 1]])


def test_a_reason_that_nobody_has_yet_changes_no_digest():
    another = np.pad(DROPPED, ((0, 0), (0, 1)))
    assert digest(ARRAYS | {"dropped": another}) == digest(ARRAYS | {"dropped": DROPPED})


def test_what_was_dropped_under_way_and_why_changes_the_digest():
    for other in (np.roll(DROPPED, 1, axis=1), DROPPED + (DROPPED > 1), np.zeros_like(DROPPED)):
        assert digest(ARRAYS | {"dropped": other}) != digest(ARRAYS | {"dropped": DROPPED})
