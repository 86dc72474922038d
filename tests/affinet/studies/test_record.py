"""What is kept of a study's verdicts: read as it was written, of which grid it is, and where a quick one contradicts."""

from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from flying import plan_of

from affinet.cli import show
from affinet.scenario.wrong import ScenarioError
from affinet.studies import judging, record, study
from affinet.studies.batch import fly_all
from affinet.studies.executor import Here
from affinet.studies.record import JudgedClaim, StudyRecord
from analysis.claims.checks import ClaimVerdict
from analysis.claims.intervals import Decision

STUDY = """
title = "Two lengths of ticks"
source = "nobody"
figure = "curves"
scenario = "rigid"
quantity = "procrustes"
set = ["time.duration=0.2"]
full = { runs = 4 }
quick = { runs = 3 }
axes = [
  { name = "graph", values = { hexa10 = [] } },
  { name = "dt", values = { short = ["time.dt=0.01"], long = ["time.dt=0.02"] } },
  { name = "estimator", values = { mle = ['agents.estimator="mle"'], rkf = ["agents.estimator=rkf"] } },
]

[[claims]]
says = "paired"
check = "lower"
each = ["dt"]
of = { estimator = "rkf" }
to = { estimator = "mle" }

[[claims]]
says = "apart"
check = "lower"
of = { estimator = "rkf", dt = "short" }
to = { estimator = "rkf", dt = "long" }
"""


ROOT_OF_RIGID = (Path(str(resources.files("affinet.shipped"))) / "scenarios" / "rigid.toml").read_text()


@pytest.fixture
def two(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(STUDY)
    return study.load(str(path))


def test_cases_of_other_ticks_are_not_called_paired(two):
    results = [*study.fly(study.plans(two, quick=True), 3, Here())]
    *paired, apart = judging.judge(two, results)
    assert apart.found.endswith("(the runs compared do not meet the same draws)")
    assert not any("draws" in one.found for one in paired)


@pytest.mark.parametrize(
    "over",
    ["seed=2", "time.dt=0.02", "sensing={sigma=0.2}", "dynamics={}", "formation.spread=2.0"],
)
def test_runs_are_paired_where_they_meet_the_same_draws(over):
    def result(*overrides):
        return study.Result({}, plan_of("rigid", "time.dt=0.01", *overrides), None)

    assert judging._paired([result(), result("agents.estimator=rkf", "network.availability=0.5")])
    assert not judging._paired([result(), result(over)])


def test_it_is_read_as_it_was_written_and_what_is_no_number_is_null(two, tmp_path):
    results = [*study.fly(study.plans(two, quick=True)[:1], 1, Here())]
    verdicts = [ClaimVerdict(claim.says, Decision.UNDECIDED, "f") for claim in judging.all_spelled_out(two)]
    kept = record.recorded(two, results, verdicts, flown=record.grid(two, quick=True), quick=True)
    record.write(tmp_path, kept)
    assert record.read(tmp_path / record.FILE) == kept
    (mean,) = kept.cases
    assert mean.quantity == "procrustes"
    assert (mean.low, mean.high) == (None, None)  # of a single run
    assert mean.found > 0.0


def test_a_grid_is_what_flies_and_not_what_is_said_of_it(two):
    claims, axes = two.model_copy(update={"claims": []}), two.model_copy(update={"axes": two.axes[:2]})
    grids = {record.grid(one, quick=quick) for one in (two, claims) for quick in (True, False)}
    assert len(grids) == 2
    assert record.grid(axes, quick=True) not in grids


def test_a_grid_is_of_the_scenario_as_it_is(tmp_path):
    def grid(old, new):
        assert old in ROOT_OF_RIGID
        (tmp_path / "own.toml").write_text(ROOT_OF_RIGID.replace(old, new))
        (tmp_path / "two.toml").write_text(STUDY.replace('"rigid"', '"own.toml"'))
        return record.grid(study.load(str(tmp_path / "two.toml")), quick=True)

    asked = grid("samples = 10", "samples = 10")
    assert grid("samples = 10", "samples = 11") != asked
    # What it leaves out, as it does keys to come, is the same as the default of it.
    assert grid('preset = "hexa10"', 'preset = "hexa10"\nscale = 1.0') == asked
    assert grid('preset = "hexa10"', 'preset = "hexa10"\nscale = 2.0') != asked


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("check", "ratio"),
        ("of", {"estimator": "mle"}),
        ("to", {"estimator": "rkf"}),
        ("quantity", "error"),
        ("to_quantity", "error"),
        ("level", 0.5),
        ("between", [0.9, 1.1]),
        ("since", 0.1),
        ("until", 0.1),
    ],
)
def test_a_claim_is_what_it_asks_and_not_how_it_says_so(two, key, value):
    claim = next(judging.all_spelled_out(two))
    said_otherwise, asked_otherwise = (claim.model_copy(update=change) for change in ({"says": "else"}, {key: value}))
    assert record.asked(two, said_otherwise) == record.asked(two, claim)
    assert record.asked(two, asked_otherwise) != record.asked(two, claim)


def test_a_record_that_was_written_to_by_hand_is_refused(tmp_path):
    record.write(tmp_path, judged(False, one="does not hold"))
    file = tmp_path / record.FILE
    assert record.read(file) == judged(False, one="does not hold")
    file.write_text(file.read_text().replace("does not hold", "holds"))
    with pytest.raises(ValueError, match="is not as the study left it: fly it again"):
        record.read(file)


def judged(quick, **decisions):
    claims = [
        JudgedClaim(
            says=f"{says}, said anew" if quick else says, asked=says, decision=Decision(said), found=f"as {said}"
        )
        for says, said in decisions.items()
    ]
    return StudyRecord(title="t", source="s", flown="", quick=quick, runs=3, confidence=0.99, claims=claims, cases=[])


def test_a_quick_study_says_where_it_contradicts_the_full_one(tmp_path, capsys):
    quick = judged(True, one="holds", two="undecided", three="does not hold", four="holds", five="holds")
    full = judged(False, one="does not hold", two="holds", three="does not hold", four="holds")
    show.claims(quick, full, tmp_path)
    shown = capsys.readouterr().out
    assert "quick: 3 runs of a coarse form" in shown
    assert "one: in the full study, of 3 runs, it does not hold: as does not hold" in shown
    assert shown.count("in the full study") == 1
    show.claims(judged(False, one="holds"), full, tmp_path)
    assert "quick:" not in capsys.readouterr().out


@pytest.mark.parametrize("name", [name for name in study.shipped() if record.full_study(name)])
def test_full_verdicts_that_come_with_affinet_are_of_the_claims_of_their_studies(name):
    full, shipped = record.full_study(name), study.load(name)
    assert not full.quick
    assert full.runs == shipped.full.runs
    assert {claim.asked for claim in full.claims} == {
        record.asked(shipped, claim) for claim in judging.all_spelled_out(shipped)
    }


def test_a_value_has_no_multiples_of_nothing(tmp_path):
    path = tmp_path / "nothing.toml"
    path.write_text(
        STUDY.replace('check = "lower"\nof', 'check = "value"\nbetween = [0.9, 1.1]\nlevel = 0.0\nof').replace(
            'to = { estimator = "rkf", dt = "long" }\n', ""
        )
    )
    with pytest.raises(ScenarioError, match="give one that is not 0"):
        study.load(str(path))


def test_a_run_that_leaves_the_numbers_is_infinitely_far_off():
    plan = plan_of("rigid", "time.dt=0.05", "time.duration=60", "record.enabled=false")
    runs = fly_all(
        replace(plan, law=replace(plan.law, parameters={"alpha": 1000.0})), [1, 2], 10
    )  # which no scenario may ask for
    assert not np.isnan(runs.quantities["error"]).any()
    assert np.isinf(runs.quantities["error"][:, -1]).all()
    assert np.isinf(runs.mean_error).all()
