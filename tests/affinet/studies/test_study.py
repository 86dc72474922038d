"""Studies: their grid, their data, their figure and a verdict on every claim."""

from functools import cache

import netcdf
import numpy as np
import pytest
from flying import PROCESSES, plan_of
from matplotlib.text import Text
from PIL import Image
from scipy.stats import chi2

from affinet.cli import commands
from affinet.scenario.wrong import ScenarioError
from affinet.studies import judging, labelled, record, report, study
from affinet.studies.batch import Runs
from affinet.studies.executor import Here
from affinet.studies.quantities import NAMES, over_time
from analysis.claims import checks
from analysis.claims.intervals import Decision
from analysis.figures import axes, curves, paths, sweeps
from analysis.metrics.indicator import Bounds

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


def flown(what):
    """What comes of it, flown quickly."""
    return [*study.fly(study.plans(what, quick=True), what.quick.runs, Here())]


def reported(out, what, results):
    """All that is written down of it, in a new directory."""
    out.mkdir()
    labelled.write(out, what, results, {})
    flown = record.grid(what, quick=True)
    record.write(out, record.recorded(what, results, judging.judge(what, results), flown=flown, quick=True))
    report.draw(out, what, results)


@pytest.fixture
def tiny(tmp_path):
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


def test_a_study_leaves_data_a_figure_and_verdicts(tiny, tmp_path, capsys):
    out = tmp_path / "out"
    assert commands.main(["study", str(tiny), "--quick", "--out", str(out)]) == 0
    judged = record.read(out / "claims.json")
    assert (judged.title, judged.quick, judged.runs) == ("Tiny", True, 2)
    # Two runs decide nothing: the means of both may be nothing at all.
    assert [claim.decision for claim in judged.claims] == ["undecided", "undecided"]
    assert [case.labels["estimator"] for case in judged.cases] == ["none", "none", "ga-rkf", "ga-rkf"]
    assert all(case.low < case.found < case.high for case in judged.cases)
    data, _ = netcdf.read(out)
    assert data["tracking_error"].values.shape == (1, 2, 2, 2)
    assert data["mean_tracking_error"].values.shape == (1, 2, 2, 20)
    assert data["estimator"].values.tolist() == ["none", "ga-rkf"]
    assert np.isfinite(data["tracking_error"].values).all()
    assert {"mean_nees", "std_nees", "mean_nis", "std_nis"} <= set(data)
    with Image.open(out / "figure.png") as figure:
        assert min(figure.size) > 300
    assert not (out / "consistency.png").exists()  # that goes with curves
    shown = capsys.readouterr().out
    assert "undecided" in shown
    assert all(f"{case.found:.4g}" in shown for case in judged.cases)
    assert "quick: 2 runs of a coarse form" in shown


@pytest.mark.parametrize("name", study.shipped())
@pytest.mark.parametrize("quick", [True, False])
def test_every_case_of_a_shipped_study_can_fly_be_drawn_and_be_judged(name, quick):
    shipped = study.load(name)
    assert [case for case, _ in study.plans(shipped, quick=quick)] == [*study.cases(shipped, quick=quick)]


OF_MOST_RUNS = {"stays_below", "leaves", "exponential"}


@pytest.mark.parametrize("name", study.shipped())
def test_a_full_study_has_runs_enough_to_decide_what_most_of_them_do(name):
    shipped = study.load(name)
    if OF_MOST_RUNS & {claim.check for claim in shipped.claims}:
        runs = shipped.full.runs
        all_do = checks.stays_below("says", np.arange(2.0), np.zeros((runs, 2)), 1.0, (0.0, None), "m")
        assert all_do.decision is Decision.HOLDS


RIGID = [name for name in study.shipped() if name.startswith(("paper-001", "paper-004"))]
NOISELESS = 1e-12  # m²


@pytest.mark.parametrize("name", RIGID)
def test_quick_forms_have_as_much_noise_in_a_second_as_the_full_ones(name):
    shipped, compared = study.load(name), 0
    full = {tuple(case.labels.values()): plan.world for case, plan in study.plans(shipped, quick=False)}
    for case, plan in study.plans(shipped, quick=True):
        coarse, fine = plan.world, full[tuple(case.labels.values())]
        if fine.sensor.common.max() > NOISELESS:
            compared += 1
            np.testing.assert_allclose(coarse.sensor.common * coarse.dt, fine.sensor.common * fine.dt, rtol=1e-9)
        pushes = [one.disturbance.covariance / one.dt for one in (coarse, fine)]
        np.testing.assert_allclose(*pushes, rtol=1e-5)
    assert compared or name == "paper-004-fig33"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('check = "lower"', 'check = "higher"', r"^tiny\.toml:31: claims\.2\.check: .*'lower'.*got \"higher\""),
        ("level = 1e9", "level = 0.0", "the level of 'flat' must be above 1, below which nothing is"),
        ("runs = 3", "rnus = 3", r"^tiny\.toml:8: full\.rnus: unknown key; did you mean \'runs\'"),
        (
            "\n[[axes]]\n",
            '\n[[axes]]\nalong = "availability"\n',
            r"axes\.1\.along: unknown key; 'along' is a key of the file itself",
        ),
        ('"ga-rkf" }\nlevel', '"nobody" }\nlevel', "no axis 'estimator' has the label 'nobody'"),
    ],
)
def test_what_is_wrong_in_a_study_is_said(old, new, says, tiny):
    tiny.write_text(TINY.replace(old, new, 1))
    with pytest.raises(ScenarioError, match=says):
        study.load(str(tiny))


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
    results = flown(mapped)
    verdicts = judging.judge(mapped, results)
    assert [verdict.says for verdict in verdicts] == ["static: losses cost nothing", "varying: losses cost nothing"]
    reported(tmp_path / "out", mapped, results)
    with Image.open(tmp_path / "out" / "figure.png") as figure:
        assert min(figure.size) > 200


def test_a_case_that_cannot_fly_is_named_before_any_has_flown(tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(MAP.replace("none = [], half", "none = ['time.dt=0.3'], half"))
    with pytest.raises(
        ScenarioError,
        match=r"^wrong\.toml: case loss=none, law=static, estimator=none: time: .*not a whole number",
    ):
        study.plans(study.load(str(path)), quick=True)


PAIR = """
title = "Two estimators"
source = "nobody"
figure = "curves"
quantity = "procrustes"
scenario = "rigid"
full = { runs = 3 }
quick = { runs = 3, set = ["time.dt=0.01", "time.duration=0.2"] }

[[axes]]
name = "graph"
values = { hexa10 = [] }

[[axes]]
name = "disturbance"
values = { none = ["dynamics={}"] }

[[axes]]
name = "estimator"
values = { MLE = ['agents.estimator="mle"'], RKF = ['agents.estimator="edge-kf"'] }

[[claims]]
says = "half the Procrustes error"
check = "ratio"
of = { estimator = "RKF" }
to = { estimator = "MLE" }
between = [0.4, 0.6]

[[claims]]
says = "a third of the estimation error since 2 s"
check = "ratio"
quantity = "estimation_error"
of = { estimator = "RKF" }
to = { estimator = "MLE" }
between = [0.3, 0.35]
since = 2.0

[[claims]]
says = "a third of the estimation error in all"
check = "ratio"
quantity = "estimation_error"
of = { estimator = "RKF" }
to = { estimator = "MLE" }
between = [0.3, 0.35]

[[claims]]
says = "the covariances stay below"
check = "stays_below"
quantity = "covariance_trace"
of = { estimator = "RKF" }
level = 0.05
"""


@pytest.fixture
def pair(tmp_path):
    path = tmp_path / "pair.toml"
    path.write_text(PAIR)
    return study.load(str(path))


RUNS = 50


@cache
def at_rest():
    return plan_of("rigid")


def made_up(labels, **values_of):
    """A case whose runs hold these values, over four seconds."""
    shape = (RUNS, 4)
    rest = {name: np.full(shape, 7e7) for name in NAMES}
    rest |= {name: np.broadcast_to(values, shape) for name, values in values_of.items()}
    runs = Runs(
        np.arange(4.0),
        mean_error=np.full(RUNS, 9e9),
        psi=np.zeros((RUNS, 4, 10)),
        bounds=Bounds(*np.ones((2, RUNS, 4, 10))),
        first={},
        quantities=rest,
    )
    return study.Result(labels, at_rest(), runs)


LARGEST = {"peak"}
ROOTS = {"found", "agreed", "ideal", "apart", "disagreed", "place_error", "behind", "effort", "roughness"}


@pytest.mark.parametrize("span", [(0.0, None), (1.0, None), (0.0, 2.0), (1.5, 3.0)], ids=str)
@pytest.mark.parametrize("quantity", NAMES)
def test_what_stands_for_a_run_over_time_is_the_mean_the_root_mean_square_or_the_largest(quantity, span):
    values = np.random.default_rng(1).uniform(1.0, 5.0, (RUNS, 4))
    since, until = span
    inside = values[:, [second for second in range(4) if since <= second <= (until or 9.0)]]
    expected = inside.mean(axis=1)
    if quantity in LARGEST:
        expected = inside.max(axis=1)
    elif quantity in ROOTS:
        expected = np.sqrt((inside**2).mean(axis=1))
    elif quantity == "error" and span == (0.0, None):
        expected = np.full(RUNS, 9e9)  # that over all ticks, and not over those kept
    found = over_time(made_up({}, **{quantity: values}).runs, quantity, span)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_span_in_which_nothing_is_kept_stands_for_nothing():
    with pytest.raises(ValueError, match=r"no moment lies in its span from 3\.5 s on: the runs end at 3 s"):
        over_time(made_up({}).runs, "peak", (3.5, None))


def test_a_claim_is_judged_by_its_quantity_or_else_by_that_of_the_study(pair):
    labels = [case.labels for case in study.cases(pair, quick=True)]
    later = np.array([1.0, 1.0, 1 / 3, 1 / 3])
    results = [
        made_up(labels[0], procrustes=0.2, estimation_error=1.0, covariance_trace=0.2),
        made_up(labels[1], procrustes=0.1, estimation_error=later, covariance_trace=0.04),
    ]
    verdicts = judging.judge(pair, results)
    assert [verdict.decision for verdict in verdicts] == ["holds", "holds", "does not hold", "holds"]
    assert verdicts[0].found.startswith("ratio 0.5 (")
    assert verdicts[1].found.startswith("ratio 0.333 (")
    assert verdicts[2].found.startswith("ratio 0.667 (")


PRINTED = """
[[claims]]
says = "the error printed,"
each = ["estimator"]
check = "value"
quantity = "agreed"
levels = { RKF = 0.25, MLE = 0.5 }
between = [0.99, 1.01]
since = 1.0
"""


def claiming(tmp_path, claims):
    """The study of two estimators, with these claims and no others."""
    path = tmp_path / "claiming.toml"
    path.write_text(PAIR.partition("[[claims]]")[0] + claims)
    return study.load(str(path))


def test_a_claim_with_levels_is_judged_for_each_label_by_its_own(tmp_path):
    printed = claiming(tmp_path, PRINTED)
    labels = [case.labels for case in study.cases(printed, quick=True)]
    # Root mean squares of what comes since one second.
    values = {"MLE": np.sqrt([9.0, 0.0, 0.25, 0.5]), "RKF": np.array([9.0, 0.3, 0.3, 0.3])}
    results = [made_up(one, agreed=values[one["estimator"]]) for one in labels]
    rkf, mle = judging.judge(printed, results)
    assert (rkf.says, mle.says) == ("RKF: the error printed, 0.25 m", "MLE: the error printed, 0.5 m")
    assert (rkf.decision, mle.decision) == ("does not hold", "holds")
    assert rkf.found.startswith("0.3 (0.3 to 0.3) m, asked 0.247 to 0.253")
    assert mle.found.startswith("0.5 (")


def test_a_claim_with_levels_says_nothing_of_other_labels(tmp_path):
    printed = claiming(tmp_path, PRINTED.replace("RKF = 0.25, MLE = 0.5", "MLE = 0.5"))
    results = [made_up(case.labels, agreed=0.5) for case in study.cases(printed, quick=True)]
    (verdict,) = judging.judge(printed, results)
    assert (verdict.says, verdict.decision) == ("MLE: the error printed, 0.5 m", Decision.HOLDS)


def test_a_level_of_a_label_that_there_is_not_is_named(tmp_path):
    with pytest.raises(
        ScenarioError, match=r"no axis 'estimator' has the label 'KF'; did you mean 'RKF'\? there are MLE, RKF"
    ):
        claiming(tmp_path, PRINTED.replace("RKF = 0.25", "KF = 0.25"))


def claim(check, *says):
    return "\n".join(["[[claims]]", 'says = "something"', f'check = "{check}"', *says])


TO, LEVEL, BETWEEN = 'to = { estimator = "MLE" }', "level = 2.0", "between = [0.5, 1.5]"
COMPARED = {
    "flat": {LEVEL},
    "approaches": {TO, LEVEL},
    "stays_below": {LEVEL},
    "leaves": {LEVEL},
    "indicator_below_error": set(),
    "lower": {TO},
    "ratio": {TO, BETWEEN},
    "exponential": set(),
    "slower_with_anchor": set(),
    "value": {LEVEL, BETWEEN},
}


@pytest.mark.parametrize("check", COMPARED)
def test_checks_want_what_they_compare_with_and_no_more(check, tmp_path):
    wanted = COMPARED[check]
    (read,) = claiming(tmp_path, claim(check, *wanted)).claims
    assert read.check == check
    for one in (TO, LEVEL, BETWEEN):
        what = one.partition(" ")[0]
        if one in wanted:
            says, given = rf"^claiming\.toml:\d+: claims\.1: the check '{check}' needs {what}$", wanted - {one}
        else:
            says, given = rf"^claiming\.toml:\d+: claims\.1: the check '{check}' has no use for {what}$", wanted | {one}
        with pytest.raises(ScenarioError, match=says):
            claiming(tmp_path, claim(check, *given))


def test_all_that_a_check_wants_is_named_and_levels_are_one_of_them(tmp_path):
    for check, says in (("ratio", "needs between and to"), ("approaches", "needs level and to")):
        with pytest.raises(ScenarioError, match=f"the check '{check}' {says}$"):
            claiming(tmp_path, claim(check))
    levels = 'each = ["estimator"]\nlevels = { MLE = 0.5 }'
    for check in ("lower", "exponential"):
        with pytest.raises(ScenarioError, match=f"the check '{check}' has no use for level$"):
            claiming(tmp_path, claim(check, levels, *COMPARED[check]))
    (read,) = claiming(tmp_path, claim("stays_below", levels)).claims
    assert read.levels == {"MLE": 0.5}


def test_a_quantity_to_compare_with_wants_something_to_compare_with(tmp_path):
    with pytest.raises(
        ScenarioError, match=r"^claiming\.toml:\d+: claims\.1: to_quantity is that of what is compared with: give to"
    ):
        claiming(tmp_path, claim("stays_below", LEVEL, 'to_quantity = "nees"'))
    (read,) = claiming(tmp_path, claim("lower", TO, 'to_quantity = "nees"')).claims
    assert read.to_quantity == "nees"


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (
            'of = { filter = "MLE" }',
            "no axis 'filter' has the label 'MLE'; no axis is called so: there are graph, disturbance, estimator",
        ),
        (
            'of = { estimator = "KF" }',
            r"no axis 'estimator' has the label 'KF'; did you mean 'RKF'\? there are MLE, RKF",
        ),
        ('to = { filter = "MLE" }', "no axis 'filter' has the label 'MLE'"),
        ('to = { estimator = "KF" }', "no axis 'estimator' has the label 'KF'"),
        ('each = ["graph", "filter"]', "no axis is called 'filter'; there are graph, disturbance, estimator"),
        ('each = ["estimator"]\nlevels = { KF = 1.0 }', "no axis 'estimator' has the label 'KF'"),
        ('each = ["filter"]\nlevels = { MLE = 1.0 }', "no axis is called 'filter'; there are graph, disturbance"),
    ],
)
def test_an_axis_or_a_label_of_a_claim_that_there_is_not_is_named(given, named, tmp_path):
    check = "lower" if given.startswith("to =") else "stays_below"
    compared = [] if check == "lower" or "levels" in given else [LEVEL]
    with pytest.raises(ScenarioError, match=named):
        claiming(tmp_path, claim(check, given, *compared))


@pytest.mark.parametrize(
    ("skip", "named"),
    [
        ('law = "statc", estimator = "rkf"', r"no axis 'law' has the label 'statc'; did you mean 'static'\? there are"),
        ('laws = "static"', "no axis 'laws' has the label 'static'"),
    ],
)
def test_an_axis_or_a_label_to_skip_that_there_is_not_is_named(skip, named, tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(MAP.replace('law = "static", estimator = "rkf"', skip))
    with pytest.raises(ScenarioError, match=named):
        study.load(str(path))


@pytest.mark.parametrize("each", ["[]", '["estimator", "graph"]'])
def test_levels_are_for_the_labels_of_one_axis(each, tmp_path):
    with pytest.raises(
        ScenarioError, match=r"^claiming\.toml:\d+: claims\.1: levels are for the labels of one axis: name it in each"
    ):
        claiming(tmp_path, PRINTED.replace('["estimator"]', each))


def test_a_study_of_a_quantity_leaves_all_quantities_and_figures(pair, tmp_path, monkeypatch):
    shown, draw = [], curves.consistency
    monkeypatch.setattr(curves, "consistency", lambda *given: shown.append(given) or draw(*given))
    pair = pair.model_copy(update={"claims": pair.claims[:1]})  # the others look beyond these 0.2 s
    results = flown(pair)
    reported(tmp_path / "out", pair, results)
    data, _ = netcdf.read(tmp_path / "out")
    assert data["estimator"].values.tolist() == ["MLE", "RKF"]
    for name in ("procrustes", "estimation_error", "covariance_trace", "nees", "nis"):
        values = [one.runs.quantities[name].mean(axis=0) for one in results]
        np.testing.assert_array_equal(data[f"mean_{name}"].values[0, 0], values)
    # The measurement is as uncertain in every tick, and the filter less and less.
    traces = data["mean_covariance_trace"].values[0, 0]
    assert np.ptp(traces[0]) < 1e-12 < 0.1 < traces[1, 0] / traces[0, 0]
    assert traces[1, -1] < 0.2 * traces[0, -1]
    assert record.read(tmp_path / "out" / "claims.json").claims[0].found.startswith("ratio")
    # Nothing is filtered by MLE; the filter, and the measurement as an estimate, are as wrong as they say.
    nees, nis = (data[f"mean_{name}"].values[0, 0] for name in ("nees", "nis"))
    assert np.isnan(nis[0]).all()
    for means in (nees[0], nees[1], nis[1]):
        assert 1.5 < means.mean() < 2.5
        assert len(np.unique(means)) == 20
    ((_, title, normalised, axes, dimension),) = shown
    assert (title, axes, dimension) == ("Two estimators", ["graph", "disturbance", "estimator"], 2)
    for name, cases in normalised.items():
        for case, one in zip(cases, results, strict=True):
            np.testing.assert_array_equal(case.error, one.runs.quantities[name.lower()])
    assert list(normalised) == ["NEES", "NIS"]
    for name in ("figure", "consistency"):
        with Image.open(tmp_path / "out" / f"{name}.png") as figure:
            assert min(figure.size) > 200


@pytest.fixture
def drawn(monkeypatch):
    """The figures that are drawn from now on."""
    kept = []

    class Kept(curves.Figure):  # type: ignore[name-defined]
        def __init__(self, **how):
            super().__init__(**how)
            kept.append(self)

    for module in (curves, paths, sweeps):
        monkeypatch.setattr(module, "Figure", Kept)
    return kept


def written_in(figure):
    return {text.get_text() for text in figure.findobj(Text)}


SWEEP = TINY.replace(
    'along = "availability"',
    """along = "availability"
quantity = "peak"
since = 1.0
bound = { at = 2.5, says = "the most" }
""",
).partition("[[claims]]")[0]


def longest(one):
    return one.runs.quantities["peak"][:, 1:].max(axis=1).mean()


def test_a_sweep_shows_what_stands_for_any_quantity_since_a_second(tmp_path, drawn):
    path = tmp_path / "sweep.toml"
    path.write_text(SWEEP)
    swept = study.load(str(path))
    rng = np.random.default_rng(1)
    early = np.full((RUNS, 1), 1e3)  # too early to count
    results = [
        made_up(case.labels, peak=np.hstack([early, rng.uniform(1.0, 2.0, (RUNS, 3))]))
        for case in study.cases(swept, quick=True)
    ]
    reported(tmp_path / "out", swept, results)
    (figure,) = drawn
    (panel,) = figure.axes
    assert written_in(figure) >= {"zhao7", "longest input (m/s²)", "availability", "the most", "none", "ga-rkf"}
    (line,) = (line for line in panel.lines if line.get_label() == "the most")
    assert line.get_ydata() == [2.5, 2.5]
    for bars, estimator in zip(panel.containers, ("none", "ga-rkf"), strict=True):
        cases = [one for one in results if one.labels["estimator"] == estimator]
        np.testing.assert_array_equal(bars[0].get_xdata(), [0.5, 1.0])
        np.testing.assert_allclose(bars[0].get_ydata(), [longest(one) for one in cases])


@pytest.mark.parametrize("figure", ["curves", "sweep"])
def test_the_same_figure_is_drawn_of_every_quantity_in_also(figure, tmp_path, drawn):
    text = SWEEP.replace("bound =", 'also = ["procrustes", "nees"]\nbound =')
    if figure == "curves":
        text = text.replace('figure = "sweep"', 'figure = "curves"').replace('along = "availability"\n', "")
    path = tmp_path / "also.toml"
    path.write_text(text)
    both = study.load(str(path))
    results = [
        made_up(case.labels, peak=2.0, procrustes=3.0, nees=np.arange(1.0, 5.0))
        for case in study.cases(both, quick=True)
    ]
    reported(tmp_path / "out", both, results)
    assert {"figure.png", "procrustes.png", "nees.png"} <= {one.name for one in (tmp_path / "out").iterdir()}
    of_procrustes, of_nees, of_peak, *_ = drawn
    said = ("Procrustes error (m)", "normalised estimation error squared", "longest input (m/s²)")
    for one, title in zip((of_procrustes, of_nees, of_peak), said, strict=True):
        assert title in written_in(one)
        assert ("the most" in written_in(one)) == (one is of_peak)  # it bounds the quantity of the study alone
    line = of_nees.axes[0].lines[0].get_ydata()
    np.testing.assert_allclose(line, np.arange(1.0, 5.0) if figure == "curves" else [3.0, 3.0])


def test_paths_are_those_of_the_first_run_of_each_case_with_what_its_first_follower_flies(pair, tmp_path, drawn):
    pair = pair.model_copy(update={"figure": "paths", "claims": []})
    results = flown(pair)
    reported(tmp_path / "out", pair, results)
    (figure,) = drawn
    planes, inputs = figure.axes[:2], figure.axes[2:]
    assert [panel.get_title() for panel in planes] == ["hexa10, none, MLE", "hexa10, none, RKF"]
    assert [panel.get_title() for panel in inputs] == ["agent 1", "agent 1"]  # its leaders are 4, 5 and 7
    for plane, flown_by, one in zip(planes, inputs, results, strict=True):
        position, steered = one.runs.first["position"], one.runs.first["input"]
        lines = [np.stack(line.get_data(), axis=-1) for line in plane.lines]
        edges, agents = lines[: len(one.plan.world.links)], lines[-11:-1]
        for agent in range(10):
            np.testing.assert_array_equal(agents[agent], position[:, agent])
        np.testing.assert_array_equal(lines[-1], position[-1])
        ends = {(round(x, 9), round(y, 9)) for line in edges for x, y in line}
        assert ends == {(round(x, 9), round(y, 9)) for x, y in position[-1]}
        for axis, line in enumerate(flown_by.lines):
            np.testing.assert_array_equal(line.get_ydata(), steered[:, 0, axis])
    with Image.open(tmp_path / "out" / "figure.png") as picture:
        assert min(picture.size) > 300


@pytest.mark.parametrize(
    ("labels", "scale"),
    [(("0.003", "0.3"), "log"), (("0.1", "1", "3"), "linear"), (("0", "1000"), "linear")],
    ids=str,
)
def test_a_sweep_over_decades_is_drawn_on_a_logarithmic_axis(labels, scale, tmp_path, drawn):
    cases = [sweeps.Mean({"W": W, "graph": "ring", "filter": "SOE"}, 1.5, 1.0, 2.0) for W in labels]
    sweeps.sweep(tmp_path / "sweep.png", "Title", cases, ["graph", "W", "filter"], "W", "error (m)")
    ((panel,),) = (figure.axes for figure in drawn)
    assert panel.get_xscale() == scale
    assert not any("$" in text for figure in drawn for text in written_in(figure))


def test_the_bars_of_a_sweep_are_the_intervals_of_its_table(tmp_path, drawn):
    path = tmp_path / "sweep.toml"
    path.write_text(SWEEP)
    swept = study.load(str(path))
    peaks = np.linspace(1.0, 2.0, RUNS)[:, None]
    results = [
        made_up(case.labels, peak=peaks * 10.0 ** (number * np.arange(RUNS)[:, None]))
        for number, case in enumerate(study.cases(swept, quick=True))
    ]
    reported(tmp_path / "out", swept, results)
    kept = record.read(tmp_path / "out" / record.FILE)
    (figure,) = drawn
    figure.draw_without_rendering()
    (panel,) = figure.axes
    drawn_ends = [sorted(bar[:, 1]) for bars in panel.containers for bar in bars[2][0].get_segments()]
    np.testing.assert_allclose(sorted(drawn_ends), sorted([case.low, case.high] for case in kept.cases))
    assert min(case.low for case in kept.cases) < 0.0 < panel.get_ylim()[0]  # it leaves at the lower edge
    (note,) = (text for text in written_in(figure) if text.startswith("Bars:"))
    assert " ".join(note.split()) == (
        "Bars: 99 % interval of the mean over the runs (Student's t); one that reaches 0 goes down to the edge."
    )


def test_a_case_without_a_number_is_marked_and_one_of_a_run_has_no_bar(tmp_path, drawn):
    labels = [{"W": W, "graph": "ring", "filter": "SOE"} for W in ("1", "2")]
    cases = [sweeps.Mean(labels[0], 1.0, np.nan, np.nan), sweeps.Mean(labels[1], np.nan, np.nan, np.nan)]
    sweeps.sweep(tmp_path / "sweep.png", "Title", cases, ["graph", "W", "filter"], "W", "error (m)")
    ((panel,),) = (figure.axes for figure in drawn)
    assert [line.get_xdata().tolist() for line in panel.lines if line.get_marker() == "x"] == [[2.0]]
    assert "One run of each case: no interval; × at the top: no number, as runs diverged." in {
        " ".join(text.split()) for text in written_in(drawn[0])
    }


def test_a_band_of_curves_says_what_it_is_and_leaves_below_where_it_reaches_nothing(tmp_path, drawn):
    error = np.array([[1.0, 1.0, 1.0], [1.0, 9.0, 100.0]])
    case = curves.Curve({"a": "1", "b": "2", "c": "3"}, np.arange(3.0), error, error[:, 0])
    curves.curves(tmp_path / "figure.png", "Title", [case], ("a", "b", "c"), "error (m)")
    (figure,) = drawn
    figure.draw_without_rendering()
    (panel,) = figure.axes
    ends = panel.collections[0].get_paths()[0].vertices
    assert ends[:, 1].min() == pytest.approx(50.5 - 49.5)
    assert any(text.startswith("Lines: mean over the runs. Bands: one") for text in written_in(figure))


def test_labels_of_a_logarithmic_axis_are_written_alike():
    figure = curves.Figure()
    panel = figure.subplots()
    panel.plot([1, 2, 3], [0.02, 1.0, 30.0])
    axes.logarithmic(panel, "y")
    figure.draw_without_rendering()
    said = {label.get_text() for label in panel.get_yticklabels()} - {""}
    assert said >= {"0.1", "1", "10"}
    assert not any("e" in text for text in said)


def test_consistency_is_drawn_as_means_over_the_runs_in_the_band_of_one_edge_of_each(drawn, tmp_path):
    rng, seconds = np.random.default_rng(1), np.arange(6.0)
    labels = [{"graph": "hexa10", "air": air, "filter": one} for air in ("clear", "lossy") for one in ("MLE", "KF")]
    values = {what: rng.uniform(1.0, 3.0, (4, 5, 6)) for what in ("NEES", "NIS")}
    values["NIS"][0] = np.nan  # MLE has none
    cases = {
        what: [curves.Curve(*one, np.zeros(5)) for one in zip(labels, [seconds] * 4, of_cases, strict=True)]
        for what, of_cases in values.items()
    }
    curves.consistency(tmp_path / "consistency.png", "Title", cases, ["graph", "air", "filter"], 3)
    (figure,) = drawn
    panels = {panel.get_title(): panel for panel in figure.axes}
    assert list(panels) == [f"{what}: hexa10, {air}" for what in ("NEES", "NIS") for air in ("clear", "lossy")]
    for row, what in enumerate(("NEES", "NIS")):
        for column, air in enumerate(("clear", "lossy")):
            panel, (band,) = figure.axes[2 * row + column], figure.axes[2 * row + column].patches
            for line, name, runs in zip(panel.lines, ("MLE", "KF"), values[what][2 * column :], strict=False):
                assert line.get_label() == name, air
                np.testing.assert_allclose(line.get_ydata(), runs.mean(axis=0))
            low, high = band.get_extents().transformed(panel.transData.inverted()).intervaly
            np.testing.assert_allclose((low, high), np.array(chi2.interval(0.95, 3 * 5)) / 5, rtol=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        (
            'to = { loss = "none", estimator = "none" }',
            "",
            r"^wrong\.toml:\d+: claims\.1: the check \'lower\' needs to",
        ),
        (
            'figure = "map"',
            'figure = "map"\nquantity = "procrustes"',
            "a map shows the mean tracking error, and no procrustes",
        ),
    ],
)
def test_a_study_that_makes_no_sense_is_refused(old, new, match, tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(MAP.replace(old, new))
    with pytest.raises(ScenarioError, match=match):
        study.load(str(path))


CUT = '{ verb = "cut", at = 0.05, until = 0.1, links = ["1-4"] }'
GUST = '{ verb = "gust", at = 0.02, until = 0.03, agents = [5], velocity = [1, 0] }'


def test_where_the_graph_changes_a_line_stands_in_the_figure(tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(curves, "curves", lambda *given: shown.append(given))
    path = tmp_path / "cut.toml"
    timeline = f"scenario = \"rigid\"\nset = ['timeline=[{CUT}, {GUST}]']"
    path.write_text(PAIR.partition("[[claims]]")[0].replace('scenario = "rigid"', timeline))
    changing = study.load(str(path))
    reported(tmp_path / "out", changing, flown(changing))
    np.testing.assert_allclose([case.changes for case in shown[0][2]], [[0.05, 0.1]] * 2)


def test_labels_of_a_logarithmic_axis_are_plain_and_titles_may_hold_a_dollar(tmp_path, drawn):
    seconds = np.linspace(0.0, 10.0, 20)
    falls = curves.Curve({"a": "$5", "b": "y", "c": "z"}, seconds, np.exp(-seconds) * np.ones((5, 1)), np.ones(5))
    curves.curves(tmp_path / "figure.png", "What $ costs", [falls], ["a", "b", "c"], "error (m)")
    written = written_in(drawn[0])
    assert "What $ costs" in written
    assert not [text for text in written if "mathdefault" in text]
