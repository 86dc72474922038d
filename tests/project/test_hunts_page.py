"""The page of the hunt: it shows what its script flew, and what it says broke something does so again."""

import json

import hunts
import pytest
from flying import PROCESSES
from paths import DOCS

from affinet.scenario import loading
from affinet.testing import flights
from affinet.testing.flights import Case
from affinet.testing.trial import Trial

pytestmark = PROCESSES

KEPT = json.loads((DOCS / "hunts.json").read_text(encoding="utf-8"))
FOUND = [(one, found) for one in KEPT["table"] for found in one["found"]]


def test_the_page_is_what_the_script_writes():
    text = (DOCS / "hunt.md").read_text(encoding="utf-8")
    assert text == hunts.page(text), "python docs/hunts.py"


def test_the_table_is_whole():
    rows = [(one["verbs"], one["invariant"], one["estimator"]) for one in KEPT["table"]]
    assert rows == [(*row, estimator) for row in hunts.ROWS for estimator in hunts.ESTIMATORS]
    assert all(one["tried"]["schedules"] == hunts.BUDGET for one in KEPT["table"] if not one["found"])
    frozen = [one["found"] for one in KEPT["table"] if one["verbs"] == "freeze"]
    assert all(frozen)


@pytest.mark.parametrize(
    ("one", "found"), FOUND, ids=[f"{one['estimator']} {one['verbs']} {one['invariant']}" for one, _ in FOUND]
)
def test_what_the_table_shows_breaks_it(one, found):
    overrides = ("time.dt=0.05", "time.duration=30", f"agents.estimator={one['estimator']}")
    trial = Trial((), found["seed"], tuple(found["faults"]))
    (flown,) = flights.fly(flights.said([one["invariant"]]), [Case(loading.load("corridor", overrides), trial)])
    assert flown.breaks(0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first", "certificate", "none"])
def test_a_command_says_again_what_the_page_shows(name):
    assert hunts._shown(hunts.SHOWN[name]) == KEPT["shown"][name]
