"""Reasons: their numbers are in arrays and digests for good, and which is the strongest does not hang on them."""

import numpy as np

from analysis.kernels.kernel import Kernel
from netem.medium import verdict
from netem.medium.verdict import BY_THE_AIR, PASSED, REASONS, STRONGEST_FIRST, VERDICT_OF, Verdict, stronger

NUMBERS = {
    "silent": 0,
    "delivered": 1,
    "delayed": 2,
    "dead": 3,
    "paused": 4,
    "departed": 5,
    "cut": 6,
    "partition": 7,
    "scripted": 8,
    "dropout": 9,
    "closed": 10,
    "range": 11,
    "jammed": 12,
    "listed": 13,
    "lost": 14,
    "overflow": 15,
    "unsaid": 16,
}


def test_no_number_has_changed():
    assert {kind.label: int(kind) for kind in Verdict} == NUMBERS


def test_every_reason_has_its_place_among_the_others():
    assert sorted(STRONGEST_FIRST) == sorted(REASONS)
    assert set(BY_THE_AIR) <= set(REASONS) - set(VERDICT_OF.values())


def test_a_message_that_two_layers_hold_is_booked_under_the_stronger():
    order = [*STRONGEST_FIRST, PASSED]
    one, other = np.meshgrid(np.array(order, dtype=np.uint8), np.array(order, dtype=np.uint8), indexing="ij")
    place = np.arange(len(order))
    assert (stronger(one, other) == np.array(order)[np.minimum(place[:, None], place)]).all()
    assert stronger(one, other).dtype == np.uint8


def test_strength_is_no_matter_of_numbers(monkeypatch):
    turned = np.full(256, 255, dtype=np.uint8)
    turned[list(reversed(STRONGEST_FIRST))] = np.arange(len(STRONGEST_FIRST))
    monkeypatch.setattr(verdict, "_RANK", turned)
    monkeypatch.setattr(verdict, "_stronger", Kernel(verdict._stronger.factory, "(),()->()", "BB->B"))
    dead, lost = np.array([Verdict.DEAD], dtype=np.uint8), np.array([Verdict.LOST], dtype=np.uint8)
    assert stronger(dead, lost) == stronger(lost, dead) == Verdict.LOST
