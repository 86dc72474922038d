"""Studies: their grid, their data, their figure and a verdict on every claim."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from flying import PROCESSES
from PIL import Image

from affinet import cli, scenario, study
from affinet import plan as planning
from affinet.sections import ScenarioError

pytestmark = PROCESSES

TINY = """
title = "Tiny"
source = "nobody"
figure = "sweep"
along = "availability"
scenario = "corridor"
set = ["time.dt=0.05", "time.duration=2"]
full = { runs = 3 }
quick = { runs = 2, set = ["time.duration=1"] }

[[axes]]
name = "graph"
values = { zhao7 = [] }

[[axes]]
name = "estimator"
values = { none = ['agents.estimator="none"'], ga-rkf = ['agents.estimator="ga-rkf"'] }

[[axes]]
name = "availability"
values = { "0.5" = ["network.availability=0.5"], "1.0" = ["network.availability=1.0"] }

[[claims]]
says = "flat"
check = "flat"
of = { estimator = "ga-rkf" }
level = 1e9

[[claims]]
says = "none is better"
check = "lower"
of = { estimator = "none", availability = "0.5" }
to = { estimator = "ga-rkf", availability = "0.5" }
"""


@pytest.fixture
def tiny(tmp_path):
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


def test_a_study_leaves_data_a_figure_and_verdicts(tiny, tmp_path, capsys):
    out = tmp_path / "out"
    assert cli.main(["study", str(tiny), "--quick", "--out", str(out)]) == 0
    verdicts = json.loads((out / "claims.json").read_text())
    assert [verdict["holds"] for verdict in verdicts] == [True, False]
    curves, runs = (pq.read_table(out / f"{name}.parquet").to_pydict() for name in ("curves", "runs"))
    assert len(runs["run"]) == 2 * 2 * 2
    assert len(curves["seconds"]) == 2 * 2 * 20
    assert set(curves["estimator"]) == {"none", "ga-rkf"}
    assert np.isfinite(runs["mean_error"]).all()
    with Image.open(out / "figure.png") as figure:
        assert min(figure.size) > 300
    assert "does not hold" in capsys.readouterr().out


@pytest.mark.parametrize("name", study.shipped())
@pytest.mark.parametrize("quick", [True, False])
def test_every_case_of_a_shipped_study_can_fly(name, quick):
    shipped = study.load(name)
    for case in study.cases(shipped, quick=quick):
        planning.make(scenario.load(shipped.scenario, case.overrides))
    labels = [case.labels for case in study.cases(shipped, quick=quick)]
    for claim in shipped.claims:
        for chosen in (claim.of, claim.to or {}):
            assert any(chosen.items() <= label.items() for label in labels), claim.says


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('check = "lower"', 'check = "higher"', "claims.1.check"),
        ("runs = 3", "rnus = 3", "full.rnus"),
        ('"ga-rkf" }\nlevel', '"nobody" }\nlevel', "no case has the labels"),
    ],
)
def test_what_is_wrong_in_a_study_is_said(old, new, says, tiny):
    tiny.write_text(TINY.replace(old, new, 1))
    with pytest.raises(ScenarioError, match=says):
        study.judge(loaded := study.load(str(tiny)), study.run(loaded, quick=True, watch=lambda _: None))


def test_an_unknown_study_is_named_with_those_there_are():
    with pytest.raises(ScenarioError, match="paper-000-fig10"):
        study.load("paper-000-fig99")


MAP = """
title = "Tiny map"
source = "nobody"
figure = "map"
scenario = "corridor"
set = ["time.dt=0.05", "time.duration=0.5"]
full = { runs = 2 }
quick = { runs = 2 }
skip = [{ law = "static", estimator = "rkf" }]

[[axes]]
name = "loss"
values = { none = [], half = ["network.availability=0.5"] }

[[axes]]
name = "law"
values = { static = ['agents.law="static"'], varying = [] }

[[axes]]
name = "estimator"
values = { none = ['agents.estimator="none"'], rkf = ['agents.estimator="rkf"'] }

[[claims]]
says = "losses cost nothing"
each = ["law"]
check = "lower"
of = { loss = "half", estimator = "none" }
to = { loss = "none", estimator = "none" }
"""


def test_a_map_leaves_out_what_it_is_told_to_and_a_claim_is_judged_for_each_label(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(MAP)
    mapped = study.load(str(path))
    cases = [tuple(case.labels.values()) for case in study.cases(mapped, quick=True)]
    assert len(cases) == 6
    assert ("none", "static", "rkf") not in cases
    results = study.run(mapped, quick=True, watch=lambda _: None)
    verdicts = study.judge(mapped, results)
    assert [verdict.says for verdict in verdicts] == ["static: losses cost nothing", "varying: losses cost nothing"]
    study.save(tmp_path / "out", mapped, results, verdicts)
    with Image.open(tmp_path / "out" / "figure.png") as figure:
        assert min(figure.size) > 200


def test_a_case_that_cannot_fly_is_named_before_any_has_flown(tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(MAP.replace("none = [], half", "none = ['time.dt=0.3'], half"))
    flown = []
    with pytest.raises(ScenarioError, match=r"case \{'loss': 'none'.*not a whole number of ticks"):
        study.run(study.load(str(path)), quick=True, watch=flown.append)
    assert flown == []
