"""The frontier of what breaks: a grid of outages, how often each breaks something, and the picture of it."""

import json

import numpy as np
import pytest
from PIL import Image

from affinet.cli import commands
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.testing import flights, frontier
from affinet.testing.hunt import Quarry
from affinet.verdicts import checkers
from affinet.verdicts.checking import Checker, CheckResult
from analysis.claims.intervals import share
from analysis.figures import frontier as drawing

BRIEF = loading.load("corridor", ("time.dt=0.05", "time.duration=0.8", "network.availability=1.0"))
NONE = (np.nan, np.nan, np.nan)


def planted(least_links, least_ticks, seeds):
    """An invariant that is broken by an outage of so many links for so many ticks, with some seeds alone."""

    def check(evidence):
        broken = any(
            len(fault.pairs) >= least_links and (fault.end - fault.start) >= least_ticks
            for fault in evidence.plan.faults
            if evidence.plan.scenario.seed in seeds
        )
        return CheckResult("planted", "fail" if broken else "pass", 0 if broken else None, "")

    return Checker("planted", check)


def flown(*invariants, seeds):
    quarry = Quarry(lambda: invariants, {(): BRIEF}, seeds, ["cut"])
    return frontier.fly_frontier(quarry, flights.in_this_process, lambda *_: None)


@pytest.fixture(scope="module")
def found():
    """Of two planted invariants, and one that is never put to the test."""
    seeds = (1, 2, 3)
    return flown(planted(4, 3, {2, 3}), planted(1, 8, {1}), checkers.converged(1e-9, by=3.0), seeds=seeds)


def test_the_frontier_is_the_planted_one(found):
    assert (found.links, found.at) == ((1, 2, 4, 6, 10, 15, 24), 0.2)
    ticks = np.round(np.array(found.seconds) / 0.05)
    np.testing.assert_array_equal(ticks, range(1, 9))
    links = np.array(found.links)[:, None]
    np.testing.assert_array_equal(found.broke[0], 2 * ((links >= 4) & (ticks >= 3)))
    np.testing.assert_array_equal(found.broke[1], np.broadcast_to(ticks >= 8, (7, 8)))
    assert (found.told[:2] == 3).all()


def test_each_cell_has_its_exact_interval_and_none_what_was_never_told(found):
    one = found.share(0, -1, -1)
    assert (one.found, one.low, one.high) == pytest.approx((2 / 3, 0.0943, 0.9916), abs=1e-4)
    assert one == share(2, 0, 3, 0.975)
    assert not found.told[2].any()


def test_no_outage_breaks_what_fails_undisturbed():
    with pytest.raises(ScenarioError, match="fails with no fault at all"):
        flown(checkers.bounded(1e-9), seeds=(1,))


def test_the_picture_and_the_numbers_are_of_the_same_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    brief = ("--set", "time.dt=0.05", "--duration", "2", "--estimator", "rkf", "--jobs", "1")
    command = ["hunt", "corridor", *brief, "--invariant", "bounded(2)", "--frontier", "broken.png", "--seeds", "1-2"]
    assert commands.main([*command, "--json"]) == 0
    said = capsys.readouterr().out
    numbers = json.loads((tmp_path / "broken.json").read_text())
    assert numbers == json.loads(said.splitlines()[-1])
    assert "bounded(2): half of the runs break it from 1 link " in said
    cells = numbers["invariants"]["bounded(2)"]
    told = np.array(cells["told"])
    assert (told == 2).all()
    np.testing.assert_allclose(np.array(cells["broke"]) / told, cells["share"])
    assert (np.array(cells["low"]) <= cells["share"]).all()
    assert (np.array(cells["high"]) >= cells["share"]).all()
    with Image.open(tmp_path / "broken.png") as picture:
        assert min(picture.size) > 300
    assert commands.main(command) == 2
    assert "name another with --frontier" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--frontier", "f.png", "--verbs", "cut"), "--frontier and --verbs: it cuts links of one scenario, and draws"),
        (("--frontier", "f.png", "--every", "one link"), "--every and --frontier: nothing is drawn"),
    ],
)
def test_a_frontier_is_of_one_scenario(options, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert commands.main(["hunt", "corridor", "--invariant", "bounded(5)", *options]) == 2
    assert says in capsys.readouterr().err


def test_a_picture_of_no_known_kind_is_refused(capsys):
    with pytest.raises(SystemExit):
        commands.main(["hunt", "corridor", "--invariant", "bounded(5)", "--frontier", "f.txt"])
    assert "give a name that ends in .png" in capsys.readouterr().err


def drawn(path, shares):
    drawing.frontier(path, "planted", (1, 2), (0.5, 1.0), [("bounded(5)", shares)])
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB"))


def test_the_picture_shows_the_shares_and_leaves_out_what_was_never_told(tmp_path):
    shares = np.array([[[0.0, 0.2], [0.4, 1.0]], [[0.0, 0.1], [0.2, 0.8]], [[0.3, 0.5], [0.7, 1.0]]])
    lost = shares.copy()
    lost[:, 0, 1] = NONE
    pictures = [drawn(tmp_path / f"{number}.png", one) for number, one in enumerate((shares, shares[:, ::-1], lost))]
    assert (pictures[0] != pictures[1]).any()
    assert (pictures[0] != pictures[2]).any()
    assert (drawn(tmp_path / "again.png", shares) == pictures[0]).all()


def test_the_line_goes_where_half_of_the_runs_begin_to_break_it():
    beyond = np.array([[False, True], [True, True]])
    assert sorted(map(sorted, drawing._border(beyond))) == [
        [(-0.5, 0.5), (0.5, 0.5)],
        [(0.5, -0.5), (0.5, 0.5)],
    ]
