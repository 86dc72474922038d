"""No test of the gallery passes by itself: with any one of its faults left out, it fails."""

import importlib
import inspect
from pathlib import Path

import pytest
from paths import ROOT

from affinet.runtimes.rehearsing import rehearse
from affinet.scenario.wrong import ScenarioError
from affinet.testing.swarm import Swarm, SwarmRuns

FAILURES = (AssertionError, ScenarioError, LookupError)
MODULES = [
    importlib.import_module(f"tests.faults.{file.stem}")
    for file in sorted((ROOT / "tests" / "faults").glob("test_*.py"))
]
GALLERY = [test for module in MODULES for name, test in vars(module).items() if name.startswith("test_")]


class Censor:
    """Counts the faults a test asks for, leaves one of them out, and flies no run twice."""

    def __init__(self, monkeypatch):
        self.asked, self.without = [], None
        honest, flown = Swarm.fault, {}

        def fault(swarm, verb, **keys):
            self.asked.append(verb)
            return swarm if len(self.asked) - 1 == self.without else honest(swarm, verb, **keys)

        def remembered(plan):
            key = plan.scenario.model_dump_json()
            if key not in flown:
                flown[key] = rehearse(plan)
            return flown[key]

        monkeypatch.setattr(Swarm, "fault", fault)
        monkeypatch.setattr("affinet.testing.swarm.rehearse", remembered)

    def fly(self, test, without=None):
        """The verbs a test asked for, with the one of this number left out."""
        self.asked, self.without = [], without
        seeds = [mark.args[0] for mark in getattr(test, "pytestmark", []) if mark.name == "affinet_seeds"]
        test(SwarmRuns("inprocess", next(iter(seeds), None), pytest.fail, Path(__file__).parent))
        return self.asked


def test_the_gallery_is_what_this_file_looks_at():
    assert len(GALLERY) >= 14
    assert all(list(inspect.signature(test).parameters) == ["swarm"] for test in GALLERY)


@pytest.mark.parametrize("test", GALLERY, ids=lambda test: test.__name__.removeprefix("test_"))
def test_a_gallery_test_fails_without_any_one_of_its_faults(test, monkeypatch):
    censor = Censor(monkeypatch)
    verbs = censor.fly(test)
    assert verbs
    for number, verb in enumerate(verbs):
        try:
            censor.fly(test, without=number)
        except FAILURES:
            continue
        pytest.fail(f"passes without its fault {number + 1}, {verb}")
