"""What an estimator of a user's own reports is a quantity of a study: drawn, judged, written down. And metrics by name."""

import netcdf
import numpy as np
import pytest
from flying import plan_of
from own_code import ESTIMATOR, broken, write
from PIL import Image

from affinet.cli import commands
from affinet.planning import making as planning
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.studies import record, study
from affinet.studies.batch import fly_all
from affinet.verdicts import checkers
from affinet.verdicts.metrics import METRICS

REPORTS = broken(
    ESTIMATOR,
    (
        "return state, estimate",
        "said = {'age': np.where(state.known, 3.0, 0.0).sum(axis=-1), 'first': state.measured[..., 0, :]}\n"
        "        return state, estimate._replace(reports=said)",
    ),
)
SHORT = ("time.duration=0.5", "time.dt=0.05", "agents.law=static", "agents.parameters={}")
STUDY = """
title = "Ages"
source = "our own"
figure = "curves"
scenario = "corridor"
quantity = "report:age"
set = ["time.duration=0.5", "time.dt=0.05", "agents.law=static", "agents.parameters={}"]
full = { runs = 2 }
quick = { runs = 2 }

[[axes]]
name = "graph"
values = { zhao7 = [] }

[[axes]]
name = "air"
values = { clear = ["network.availability=1.0"] }

[[axes]]
name = "estimator"
values = { own = ["agents.estimator=NAME:Own"], rkf = ["agents.estimator=rkf"] }

[[claims]]
says = "all neighbours are known"
check = "stays_below"
of = { estimator = "own" }
level = 13.0
"""


@pytest.fixture
def own(tmp_path):
    return tmp_path, write(tmp_path, REPORTS)


def written(folder, text):
    (folder / "ages.toml").write_text(text)
    return study.load(str(folder / "ages.toml"))


def test_a_report_is_the_mean_length_over_the_agents_of_each_run(own):
    folder, name = own
    plan = planning.make(loading.load("corridor", (*SHORT, f"agents.estimator={name}:Own"), folder))
    runs = fly_all(plan, [plan.scenario.seed, 9], 1)
    arrays = rehearse(plan).arrays
    np.testing.assert_allclose(runs.quantities["report:age"][0], arrays["age"].mean(axis=1), rtol=1e-12)
    lengths = np.linalg.norm(arrays["first"], axis=-1).mean(axis=1)
    np.testing.assert_allclose(runs.quantities["report:first"][0], lengths, rtol=1e-12)


def test_a_study_draws_judges_and_writes_down_what_an_estimator_reports(own, capsys):
    folder, name = own
    only = STUDY.replace("NAME", name).replace(', rkf = ["agents.estimator=rkf"]', "")
    (folder / "ages.toml").write_text(only)
    assert commands.main(["study", str(folder / "ages.toml"), "--out", str(folder / "out")]) == 0, capsys.readouterr()
    (claim,) = record.read(folder / "out" / "claims.json").claims
    assert claim.found.startswith("2 of 2 runs stay below 13")
    data, _ = netcdf.read(folder / "out")
    assert data["mean_report:age"].values.max() <= 12.0
    assert "report:first" in data
    with Image.open(folder / "out" / "figure.png") as figure:
        assert min(figure.size) > 100


def test_a_report_that_a_case_does_not_have_is_refused_before_it_flies(own):
    folder, name = own
    with pytest.raises(
        ScenarioError, match=r"quantity: no report is called 'age': the estimator of the case .*rkf has none"
    ):
        study.plans(written(folder, STUDY.replace("NAME", name)), quick=True)


def test_a_quantity_that_is_none_is_refused_with_the_nearest(own):
    folder, _ = own
    with pytest.raises(
        ScenarioError, match="'report:name' of what an estimator reports, got \"eror\"; did you mean 'error'"
    ):
        written(folder, STUDY.replace("report:age", "eror"))


def evidence(*overrides):
    return rehearse(plan_of("corridor", *SHORT, *overrides))


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_can_be_checked_of_a_run_and_is_that_of_a_study(name):
    plan = plan_of("corridor", *SHORT, "agents.estimator=rkf")
    values = fly_all(plan, [plan.scenario.seed], 1).quantities[name][0]
    largest = np.nanmax(values)
    passed = checkers.below(name, 1.001 * largest).check(rehearse(plan))
    failed = checkers.below(name, 0.999 * largest).check(rehearse(plan))
    assert (passed.verdict, failed.verdict) == ("pass", "fail")
    assert failed.tick == int(np.nanargmax(values))


def test_a_metric_that_is_nowhere_defined_proves_nothing():
    assert checkers.below("nis", 1.0).check(evidence("agents.estimator=none")).verdict == "vacuous"


def test_a_metric_that_there_is_not_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match="no metric 'neess'; did you mean 'nees'"):
        checkers.below("neess", 1.0)
