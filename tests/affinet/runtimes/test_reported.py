"""What an estimator reports: refused where it could not be kept, and in the arrays of a run by name."""

import numpy as np
import pytest
from flying import plan_of
from pursuits import COARSE, NAME, refusal
from scripted import timeline

from affinet.runtimes.rehearsing import rehearse


def reporting(name):
    return 'agents.estimator="reporting:Reporting"', f'agents.parameters.reporting:Reporting.name="{name}"'


@pytest.mark.parametrize("name", ["position", "error", "verdicts", "target", "psi", "known", "age_of_news"])
def test_a_report_with_a_name_that_every_run_has_is_refused(name):
    said = refusal(*reporting(name), name="localization")
    assert f"reports {name}, which every run has already" in said


def test_a_report_that_could_not_be_kept_or_judged_is_refused():
    assert "the estimator reports 'place', which is where an agent believes it is, (..., 2), not (3,)" in refusal(
        *reporting("place"), name="localization"
    )
    assert "a report has a name of 70000 letters: give it at most 100" in refusal(
        *reporting("n" * 70_000), name="corridor"
    )


def test_reports_land_in_the_arrays_by_name_and_are_no_numbers_for_who_is_dead():
    dead = timeline({"verb": "kill", "at": 0.05, "agents": [5]}, {"verb": "restart", "at": 0.1, "agents": [5]})
    run = rehearse(plan_of("localization", "time.duration=0.2", dead, *reporting("says")))
    said = run.arrays["says"]
    assert said.shape == (20, 10, 3)
    assert run.plan.reports == {"says": (3,)}
    gone = np.isnan(said).all(axis=-1)
    np.testing.assert_array_equal(np.flatnonzero(gone[:, 4]), range(5, 10))
    assert not np.delete(gone, 4, axis=1).any()
    np.testing.assert_array_equal(said[0], np.arange(30.0).reshape(10, 3))


def test_who_pursues_tells_where_and_how_surely():
    dead = timeline({"verb": "kill", "at": 0.05, "agents": [5]})
    arrays = rehearse(plan_of(NAME, *COARSE, "time.duration=0.1", dead)).arrays
    shapes = {"reference": (3, 2), "found": (2,), "variance": (), "information": (3, 7), "fused": (3, 7)}
    for name, shape in shapes.items():
        assert arrays[name].shape == (10, 10, *shape)
        assert np.isnan(arrays[name][5:, 4]).all()
        assert np.isfinite(arrays[name][:5]).all()
        assert np.isfinite(np.delete(arrays[name], 4, axis=1)).all()
