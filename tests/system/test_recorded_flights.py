"""A recorded flight stands in for the world: agents that hear the same believe the same, whoever flew it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import logs
import numpy as np
import pytest
from logs import Row

from affinet.planning import making
from affinet.planning.plan import PlanError
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts.checkers import bounded, collision_free, consistent
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.outcome import Outcome
from netem.medium.verdict import Verdict
from world.books import history
from world.books.history import Arrays

SHORT = ["time.duration=0.5", "record.enabled=false"]


def flown(out: Path, *overrides: str, runtime: str = "inprocess", scenario: str = "corridor") -> tuple[Outcome, Arrays]:
    plan = making.make(loading.load(scenario, [*SHORT, *overrides]))
    return fly(plan, runtime, out, lambda *_: None), history.load(out / history.ARRAYS)


def recorded(flight: Path) -> list[str]:
    return ['world="recorded"', f'recorded.flight="{flight}"']


@pytest.fixture(scope="module")
def before(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight that was simulated."""
    out = tmp_path_factory.mktemp("flights") / "simulated"
    assert flown(out)[0].verdict == "pass"
    return out


@pytest.fixture(scope="module")
def rows(before: Path) -> list[Row]:
    return logs.rows_of(before)


def digest_of(out: Path) -> str:
    return history.digest(history.load(out / history.ARRAYS))


@pytest.mark.parametrize("runtime", ["inprocess", "processes"])
def test_a_run_flown_again_from_its_directory_is_the_run(before: Path, tmp_path: Path, runtime: str) -> None:
    outcome, _ = flown(tmp_path / "again", *recorded(before), runtime=runtime)
    assert (outcome.verdict, outcome.digest) == ("pass", digest_of(before))


@pytest.mark.parametrize("runtime", ["inprocess", "processes"])
def test_a_log_of_the_run_is_the_run(before: Path, rows: list[Row], tmp_path: Path, runtime: str) -> None:
    outcome, _ = flown(tmp_path / "again", *recorded(logs.written(tmp_path / "log.csv", rows)), runtime=runtime)
    assert (outcome.verdict, outcome.digest) == ("pass", digest_of(before))


@pytest.mark.parametrize("what", ["relative_x", "input_y", "position_x"])
def test_a_log_with_one_other_number_is_another_flight(
    before: Path, rows: list[Row], tmp_path: Path, what: str
) -> None:
    other, place = list(rows), next(n for n, row in enumerate(rows) if what in row and row["time"] > 0.2)
    other[place] = other[place] | {what: other[place][what] + 1e-9}
    outcome, _ = flown(tmp_path / "again", *recorded(logs.written(tmp_path / "log.csv", other)))
    assert outcome.digest != digest_of(before)


def test_a_log_in_any_order_is_the_same_flight(before: Path, rows: list[Row], tmp_path: Path) -> None:
    shuffled = [rows[n] for n in np.random.default_rng(1).permutation(len(rows)).tolist()]
    outcome, _ = flown(tmp_path / "again", *recorded(logs.written(tmp_path / "log.csv", shuffled)))
    assert outcome.digest == digest_of(before)


def test_times_may_begin_anywhere(rows: list[Row], tmp_path: Path) -> None:
    later = [row | {"time": row["time"] + 1_764_000_000.0} for row in rows]
    log, other = logs.written(tmp_path / "log.csv", rows), logs.written(tmp_path / "later.csv", later)
    one, _ = flown(tmp_path / "one", *recorded(log))
    two, arrays = flown(tmp_path / "two", *recorded(other))
    np.testing.assert_allclose(
        arrays["position"], history.load(tmp_path / "one" / history.ARRAYS)["position"], atol=1e-6
    )
    assert one.messages == two.messages


def test_ranges_and_bearings_are_relative_positions(before: Path, rows: list[Row], tmp_path: Path) -> None:
    log = logs.written(tmp_path / "log.csv", [logs.as_ranges(row) for row in rows])
    _, arrays = flown(tmp_path / "again", *recorded(log))
    was = history.load(before / history.ARRAYS)
    np.testing.assert_allclose(arrays["measured"], was["measured"], atol=1e-12)
    np.testing.assert_allclose(arrays["estimate"], was["estimate"], atol=1e-9)


@pytest.mark.parametrize("runtime", ["inprocess", "processes"])
def test_where_the_log_has_a_gap_nothing_is_measured(rows: list[Row], tmp_path: Path, runtime: str) -> None:
    def is_kept(row: Row) -> bool:
        return not (row["agent"] == 4 and "neighbour" in row and 0.1 < row["time"] <= 0.3)

    log = logs.written(tmp_path / "log.csv", [row for row in rows if is_kept(row)])
    outcome, arrays = flown(
        tmp_path / "gap", *recorded(log), "network.availability=1.0", "network.profile=perfect", runtime=runtime
    )
    links = making.make(loading.load("corridor")).world.links
    own, in_gap = links.dst == 4, slice(11, 31)
    silent = arrays["verdicts"][:, 0] == Verdict.SILENT
    assert silent[in_gap][:, own].all()
    assert not silent[in_gap][:, ~own].any()
    assert not np.delete(silent, np.arange(11, 31), axis=0).any()
    assert outcome.messages["offered"] == arrays["verdicts"].size - 20 * own.sum()
    assert outcome.verdict == "pass"


def test_a_tick_takes_the_last_of_what_was_measured_since_the_one_before(rows: list[Row], tmp_path: Path) -> None:
    extra = [
        {"time": 0.203, "agent": 4, "neighbour": 1, "relative_x": 7.0, "relative_y": 8.0},
        {"time": 0.207, "agent": 4, "neighbour": 1, "relative_x": 5.0, "relative_y": 6.0},
    ]
    gone = [row for row in rows if not (row["time"] == pytest.approx(0.21) and row.get("neighbour") == 1)]
    log = logs.written(tmp_path / "log.csv", [*gone, *extra])
    _, arrays = flown(tmp_path / "run", *recorded(log))
    link = making.make(loading.load("corridor")).world.links.index[1, 4]
    assert arrays["measured"][21, link].tolist() == [-5.0, -6.0]


@pytest.mark.parametrize("runtime", ["inprocess", "processes"])
def test_without_a_reference_there_is_no_error(rows: list[Row], tmp_path: Path, runtime: str) -> None:
    log = logs.written(tmp_path / "log.csv", list(map(logs.without("position"), rows)))
    outcome, arrays = flown(tmp_path / "run", *recorded(log), "record.enabled=true", runtime=runtime)
    assert outcome.verdict == "pass"
    assert np.isnan(arrays["position"]).all()
    assert not outcome.errors
    assert arrays["known"].any()
    evidence = Evidence(making.make(loading.load("corridor", [*SHORT, *recorded(log)])), arrays, outcome)
    for checker in (bounded(1.0), collision_free(0.1), consistent()):
        assert checker(evidence).verdict == "vacuous", checker(evidence)


@pytest.mark.parametrize(
    ("by_place", "says"),
    [
        ("network.zones=[{centre=[0.0,0.0],radius=1.0,share=1.0}]", "network: .*need a reference"),
        ('timeline=[{verb="cut",links=["1-2"],when={tracking_error_below=0.01},lasts=0.1}]', "timeline: .*needs a ref"),
    ],
)
def test_without_a_reference_nothing_goes_by_places(rows: list[Row], tmp_path: Path, by_place: str, says: str) -> None:
    log = logs.written(tmp_path / "log.csv", list(map(logs.without("position"), rows)))
    with pytest.raises(ScenarioError, match=says):
        making.make(loading.load("corridor", [*SHORT, *recorded(log), by_place]))
    assert making.make(loading.load("corridor", [*SHORT, *recorded(logs.written(log, rows)), by_place]))


def test_a_sensor_that_freezes_in_a_gap_repeats_what_it_said_last(rows: list[Row], tmp_path: Path) -> None:
    def is_kept(row: Row) -> bool:
        return "neighbour" not in row or round(row["time"] / 0.01) % 5 == 0

    log = logs.written(tmp_path / "log.csv", [row for row in rows if is_kept(row)])
    freeze = 'timeline=[{verb="freeze",links=["1->4"],at=0.13,lasts=0.1}]'
    _, arrays = flown(tmp_path / "run", *recorded(log), freeze)
    link = making.make(loading.load("corridor")).world.links.index[1, 4]
    said = arrays["measured"][:, link]
    np.testing.assert_array_equal(said[13:23], np.broadcast_to(said[10], (10, 2)))
    assert np.isnan(said[[11, 12, 23, 24]]).all()
    assert not np.isnan(said[[10, 25]]).any()


def test_a_flight_in_which_nothing_is_measured_proves_nothing(rows: list[Row], tmp_path: Path) -> None:
    log = logs.written(tmp_path / "log.csv", [row for row in rows if "neighbour" not in row])
    outcome, _ = flown(tmp_path / "run", *recorded(log))
    assert (outcome.verdict, outcome.reasons) == ("vacuous", ("nothing was measured in any tick: it proved nothing",))
    plan = making.make(loading.load("corridor", [*SHORT, *recorded(log)]))
    assert [one.says for one in plan.findings if one.check == "recorded"] == [
        "100.0% of the measurements of 50 ticks are gaps: nothing is measured there"
    ]


def test_what_is_said_after_the_run_changes_nothing(before: Path, rows: list[Row], tmp_path: Path) -> None:
    late = {"time": 1e11, "agent": 4, "neighbour": 1, "relative_x": 77.0, "relative_y": 77.0}
    outcome, _ = flown(tmp_path / "run", *recorded(logs.written(tmp_path / "log.csv", [*rows, late])))
    assert outcome.digest == digest_of(before)


def test_localization_keeps_its_own_error(tmp_path: Path) -> None:
    out = tmp_path / "localized"
    was, _ = flown(out, scenario="localization")
    again, _ = flown(tmp_path / "again", *recorded(out), scenario="localization")
    assert again.errors["localization_error"] == was.errors["localization_error"]


@pytest.mark.parametrize(
    ("file", "change", "says"),
    [
        ("measured", lambda array: array[:, :10], "where (24, 2) are due"),
        ("position", lambda array: array[:, :3], "where (7, 2) are due"),
        ("input", lambda array: array[..., :1], "where (7, 2) are due"),
        ("input", lambda array: array * np.nan, "no robot can have"),
        ("position", lambda array: array + np.inf, "no robot can have"),
        ("measured", lambda array: array.astype(np.float32), "float32"),
    ],
)
def test_a_run_directory_that_was_changed_is_refused(
    before: Path, tmp_path: Path, file: str, change: Callable[[np.ndarray], np.ndarray], says: str
) -> None:
    place = Path(shutil.copytree(before, tmp_path / "copy")) / "arrays" / f"{file}.npy"
    np.save(place, change(np.load(place)))
    with pytest.raises(ScenarioError) as refused:
        making.make(loading.load("corridor", [*SHORT, *recorded(tmp_path / "copy")]))
    assert says in str(refused.value)
    assert str(place) in str(refused.value)


@pytest.mark.parametrize("garbage", [b"", b"no array", b"\x93NUMPY\x01\x00v\x00{{{" + b" " * 110])
def test_a_run_directory_that_is_damaged_is_refused(before: Path, tmp_path: Path, garbage: bytes) -> None:
    place = Path(shutil.copytree(before, tmp_path / "copy")) / "arrays" / "measured.npy"
    place.write_bytes(garbage)
    with pytest.raises(ScenarioError, match=r"measured\.npy: not what a run wrote there"):
        making.make(loading.load("corridor", [*SHORT, *recorded(tmp_path / "copy")]))


def test_a_run_of_another_kind_of_sensor_is_refused(before: Path) -> None:
    polar = ["sensing.sigma_range=0.1", "sensing.sigma_bearing=0.01", "agents.estimator=rkf"]
    with pytest.raises(ScenarioError, match="set sensing alike"):
        making.make(loading.load("corridor", [*SHORT, *recorded(before), *polar]))


def test_a_direction_to_where_one_is_is_refused(rows: list[Row], tmp_path: Path) -> None:
    log = logs.written(tmp_path / "log.csv", _changed(_MEASURES, relative_x=0.0, relative_y=0.0)(rows))
    directions = ["sensing.sigma_direction=0.05", "agents.estimator=edge-kf"]
    with pytest.raises(ScenarioError, match="line 9: it measures no direction"):
        making.make(loading.load("corridor", [*SHORT, *recorded(log), *directions]))


def test_the_error_is_held_against_the_reference(rows: list[Row], tmp_path: Path) -> None:
    said, arrays = flown(tmp_path / "right", *recorded(logs.written(tmp_path / "log.csv", rows)))
    links = making.make(loading.load("corridor")).world.links
    position = arrays["position"][:-1]
    true = position[:, :, None] - position[:, links.neighbours]
    squared = ((arrays["estimate"] - true) ** 2).sum(axis=-1)
    each = [np.sqrt(row[known].mean()) for row, known in zip(squared, arrays["known"], strict=True) if known.any()]
    assert said.errors["edge_error"]["mean"] == pytest.approx(np.mean(each))
    astray = [row | {"position_x": row["position_x"] + row["agent"]} if "position_x" in row else row for row in rows]
    wrong, _ = flown(tmp_path / "wrong", *recorded(logs.written(tmp_path / "astray.csv", astray)))
    assert wrong.errors["edge_error"]["mean"] > 1.0


def test_a_run_flies_again_when_the_log_is_gone(before: Path, rows: list[Row], tmp_path: Path) -> None:
    for place in (shutil.copytree(before, tmp_path / "moved"), logs.written(tmp_path / "log.csv", rows)):
        out = tmp_path / f"of-{place.name}"
        first, _ = flown(out, *recorded(place))
        shutil.rmtree(place) if place.is_dir() else place.unlink()
        again = fly(
            making.again(out, (), verdicts=False), "inprocess", tmp_path / f"again-{place.name}", lambda *_: None
        )
        assert again.digest == first.digest


def test_other_verdicts_and_estimators_fly_on_the_same_log(before: Path, tmp_path: Path) -> None:
    believed = {}
    for name in ("rkf", "ga-rkf"):
        _, arrays = flown(tmp_path / name, *recorded(before), f"agents.estimator={name}", "network.availability=0.5")
        believed[name] = arrays
    np.testing.assert_array_equal(believed["rkf"]["measured"], believed["ga-rkf"]["measured"])
    np.testing.assert_array_equal(believed["rkf"]["input"], believed["ga-rkf"]["input"])
    assert not np.array_equal(believed["rkf"]["estimate"], believed["ga-rkf"]["estimate"])


def _changed(place: int, **cells: object) -> Callable[[list[Row]], list[Row]]:
    return lambda rows: [row | cells if n == place else row for n, row in enumerate(rows)]


_MEASURES = 7  # the first row with a neighbour


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (_changed(0, time=""), "line 2: there is no time"),
        (_changed(0, agent=9), "its agent is none of 1 to 7"),
        (_changed(0, agent=1.5), "its agent is none of 1 to 7"),
        (_changed(_MEASURES, neighbour=99), "its neighbour is none of 1 to 7"),
        (_changed(_MEASURES, agent=1, neighbour=1), "a neighbour that is none in this formation"),
        (_changed(_MEASURES, relative_x=""), "half of a relative position"),
        (_changed(_MEASURES, relative_x="", relative_y="", range=1.0), "half of a relative position"),
        (_changed(0, input_x=""), "half of input"),
        (_changed(_MEASURES, relative_x="abc"), "no CSV file of numbers"),
        (_changed(_MEASURES, relative_x="inf"), "line 9: relative_x is inf, which no robot can say"),
        (_changed(_MEASURES, relative_x=1e300), "line 9: relative_x is 1e.300, which no robot can say"),
        (
            _changed(_MEASURES, relative_x="", relative_y="", range=-1.0, bearing=0.5),
            "line 9: it measures a range below 0",
        ),
        (_changed(_MEASURES, relative_x="", relative_y="", range=1.0, bearing=90.0), "more than a turn: give rad"),
        (_changed(_MEASURES, range=1.0, bearing=0.5), "a relative position twice"),
        (_changed(_MEASURES, input_x=1.0, input_y=1.0), "of rows without neighbour"),
        (_changed(0, relative_x=1.0, relative_y=1.0), "names no neighbour"),
        (_changed(0, relativ_x=1.0), "no column 'relativ_x' in such a log; did you mean"),
        (lambda rows: list(map(logs.without("agent"), rows)), "it has no column 'agent'"),
        (lambda rows: rows[:200], "it ends after"),
        (lambda rows: [row for row in rows if row["agent"] != 3 or "neighbour" in row], "not where 3: say it of all"),
        (
            lambda rows: [row for row in rows if row["agent"] != 3 or "neighbour" in row or row["time"] < 0.2],
            "where agent 3 is from 0 to",
        ),
        (lambda rows: rows[:0], "no"),
    ],
)
def test_what_is_no_log_of_this_flight_is_refused(
    rows: list[Row], tmp_path: Path, change: Callable[[list[Row]], list[Row]], says: str
) -> None:
    log = logs.written(tmp_path / "log.csv", change(rows))
    with pytest.raises(ScenarioError, match=r"recorded\.flight: .*log\.csv.*" + says):
        making.make(loading.load("corridor", [*SHORT, *recorded(log)]))


def test_a_log_that_is_not_utf8_is_refused_by_its_name(rows: list[Row], tmp_path: Path) -> None:
    """Before: what was wrong with a byte, of no file."""
    log = logs.written(tmp_path / "log.csv", rows)
    log.write_bytes(log.read_bytes().replace(b"time", b"h\xf6he", 1))
    with pytest.raises(ScenarioError, match=r"recorded\.flight: .*log\.csv: no CSV file of numbers"):
        making.make(loading.load("corridor", [*SHORT, *recorded(log)]))


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (["time.dt=0.02"], "time.dt alike"),
        (["time.duration=0.6"], "ends after 0.5 s"),
        (["formation.preset=hexa10"], "leave the formation as it was"),
        (["dynamics.model=double-integrator", "agents.law=double-varying-velocity"], "leave it a single-integrator"),
        (["recorded.flight=/nowhere"], "No such file"),
    ],
)
def test_a_run_of_another_clock_or_length_is_refused(before: Path, overrides: list[str], says: str) -> None:
    with pytest.raises((ScenarioError, PlanError), match=says):
        making.make(loading.load("corridor", [*SHORT, *recorded(before), *overrides]))


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (['world="recorded"'], r"needs a table \[recorded\]"),
        (['world="external"'], r"needs a table \[external\]"),
        (["recorded.flight=x"], r"\[recorded\] is of world = \"recorded\", not of \"simulated\""),
        (['world="elsewhere"'], "simulated"),
    ],
)
def test_a_world_and_its_table_go_together(overrides: list[str], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        loading.load("corridor", overrides)


def test_what_bodies_feel_is_refused_where_none_are_simulated(before: Path) -> None:
    gust = {"verb": "gust", "agents": [4], "at": 0.1, "lasts": 0.1, "velocity": [1.0, 0.0]}
    given = loading.extended(loading.load("corridor", [*SHORT, *recorded(before)]), [gust])
    with pytest.raises(ScenarioError, match="a gust cannot push bodies"):
        making.make(given)


def test_sensors_that_fail_fail_on_what_was_recorded(before: Path, tmp_path: Path) -> None:
    bias = {"verb": "bias", "links": ["1->4"], "at": 0.1, "lasts": 0.2, "by": [0.5, 0.0]}
    given = loading.extended(loading.load("corridor", [*SHORT, *recorded(before)]), [bias])
    outcome = fly(making.make(given), "inprocess", tmp_path / "run", lambda *_: None)
    was, now = (history.load(out / history.ARRAYS)["measured"] for out in (before, tmp_path / "run"))
    moved = np.flatnonzero((was != now).any(axis=(1, 2)))
    assert (moved[0], moved[-1]) == (10, 29)
    assert outcome.verdict == "pass"
