"""Scorecards: those that are shipped can fly, and what is wrong in one is a line with its key."""

import numpy as np
import pytest

from affinet.planning import making
from affinet.scenario import files, loading
from affinet.scenario.wrong import ScenarioError
from affinet.score import card as cards
from affinet.score.card import Worsening

CARD = """\
title = "mine"
seeds = 3
quick_seeds = 2

[[tasks]]
name = "corridor"
says = "seven fly"
scenario = "corridor"
lost = 1.0
recovered = 0.4
quick = true

[[airs]]
name = "perfect"
says = "nothing is lost"
quick = true
"""
WORSE = '[[worsenings]]\nname = "loss"\nsays = "lost"\nset = ["network.availability={rest}"]\nmost = 0.9\n'


@pytest.mark.parametrize("name", files.shipped("scorecards"))
def test_everything_on_a_card_that_is_shipped_can_fly(name):
    card = cards.load(name)
    assert card.quickly().tasks
    for task in card.tasks:
        assert set(task.quick_rivals) <= set(task.rivals)
        worst = [one.at(bad) for one in card.worsenings for bad in (one.least_tried, one.most / 2, one.most)]
        for more in [*(air.set for air in card.airs), *worst, task.noisier]:
            making.make(loading.load(task.scenario, (*task.set, *more)))


def test_the_quick_form_has_what_says_so(tmp_path):
    (tmp_path / "mine.toml").write_text(CARD + WORSE)
    card = cards.load(str(tmp_path / "mine.toml"))
    assert (card.seeds, card.folder) == (3, tmp_path)
    quick = card.quickly()
    assert (quick.seeds, [task.name for task in quick.tasks], quick.worsenings) == (2, ["corridor"], [])


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("seeds = 3", "seeds = 1", "seeds: should be greater than or equal to 2"),
        ("lost = 1.0", "lost = 0", "tasks.1.lost: should be greater than 0"),
        ("lost = 1.0", "los = 1.0", "unknown key"),
        ("lost = 1.0", "lost = 0.01", "recovered: a swarm that is lost has not recovered: give no more than lost"),
        ('scenario = "corridor"', "", "tasks.1.scenario: is missing"),
        ("quick = true\n\n[[airs]]", "\n[[airs]]", "tasks: give one quick = true at least"),
        ("[[airs]]", '[[airs]]\nname = "perfect"\nsays = "twice"\n\n[[airs]]', "airs: 'perfect' stands there twice"),
        ("[[airs]]", WORSE.replace("{rest}", "0.5") + "[[airs]]", "no override has {x} or {rest}"),
        ("[[airs]]", WORSE.replace("most = 0.9", "most = 0.9\nleast = 1.0") + "[[airs]]", "least: give less than most"),
        ("title = ", "title ", "not TOML"),
    ],
)
def test_what_is_wrong_in_a_card_is_one_line(tmp_path, old, new, says):
    assert old in CARD
    (tmp_path / "mine.toml").write_text(CARD.replace(old, new))
    with pytest.raises(ScenarioError) as caught:
        cards.load(str(tmp_path / "mine.toml"))
    assert says in str(caught.value)
    assert str(caught.value).startswith("mine.toml")
    assert "\n" not in str(caught.value)


def test_a_card_that_there_is_not_is_named():
    with pytest.raises(ScenarioError, match="edgs: no such file, and no such scorecard; did you mean 'edges'"):
        cards.load("edgs")


def test_worse_is_half_way_by_halves_or_by_factors():
    halves = Worsening(name="loss", says="", set=["network.availability={rest}"], most=0.8)
    factors = Worsening(name="burst", says="", set=["x={x}"], least=2.0, most=200.0)
    np.testing.assert_allclose(halves.between(np.array([0.2]), np.array([0.6])), [0.4])
    np.testing.assert_allclose(factors.between(np.array([2.0]), np.array([200.0])), [20.0])
    assert halves.at(0.25) == ["network.availability=0.75"]
    assert factors.at(20.0) == ["x=20"]


@pytest.mark.parametrize("least", [0.0, 2.0])
def test_what_bisection_finds_lies_somewhere_in_the_range_that_is_left(least):
    worse = Worsening(name="loss", says="", set=["x={x}"], least=least, most=200.0)
    for point in np.linspace(least + 1e-3, 199.0, 57):
        low, high = np.array(least), np.array(200.0)
        for _ in range(cards.STEPS):
            middle = worse.between(low, high)
            low, high = (low, middle) if middle >= point else (middle, high)
        at_once = float(low) == least
        found = least if at_once else float(worse.between(low, high))
        around = worse.around(found)
        assert around[0] - 1e-9 <= point <= around[1] + 1e-9
        assert around[1] - around[0] == pytest.approx(float(high - low), rel=0.01)
        assert around[0] >= least
    assert worse.around(np.inf) == (np.inf, np.inf)
    assert worse.around(-np.inf) == (-np.inf, -np.inf)
