"""The page of the built-in estimators: it is what its script writes of the score, and what it answers is what came out."""

import json
import re

import pytest
import score_page
from paths import DOCS

from affinet.scenario import files

KEPT = json.loads((DOCS / "built-in.json").read_text(encoding="utf-8"))
PLANE = ("corridor", "turns")


def best(who, air, tasks=("corridor", "turns", "ravine")):
    """Whether somebody is among the best in an air, in all of these tasks."""
    return all(one["entrants"][who]["best"] for one in KEPT["cells"] if one["air"] == air and one["task"] in tasks)


def count(who):
    of = [one["entrants"][who]["best"] for one in KEPT["cells"] if who in one["entrants"]]
    return sum(of) / len(of)


def point(who, worsening, task):
    (found,) = (
        one["median"]["found"]
        for one in KEPT["points"]
        if (one["entrant"], one["worsening"], one["task"]) == (who, worsening, task)
    )
    return float(found)


def too_small(who):
    found = [one["entrants"][who]["nees"] for one in KEPT["cells"] if who in one["entrants"]]
    return sum(one is None or one > 1.1 for one in found) / len(found)


def test_the_page_is_what_the_script_writes():
    assert (DOCS / "built-in.md").read_text(encoding="utf-8") == score_page.page(), "python docs/score_page.py"


EDGES = ("edge-kf", "joint-kf")
OTHERS = ("none", "rkf", "imm", "ral", "conral", "ga-rkf", "silent-kf")


def of(who, air, task, what):
    (found,) = (one["entrants"][who][what] for one in KEPT["cells"] if (one["air"], one["task"]) == (air, task))
    return found


def in_the_plane(who):
    those = [one["entrants"][who]["best"] for one in KEPT["cells"] if one["task"] in PLANE]
    return sum(those) / len(those)


def test_filters_of_edges_are_the_best_in_the_plane_most_often():
    assert all(in_the_plane(edge) > in_the_plane(who) for edge in EDGES for who in OTHERS)
    for edge in EDGES:
        for air in ("perfect", "blind"):
            for task in PLANE:
                assert 0.58 < of(edge, air, task, "error") / of("ga-rkf", air, task, "error") < 0.81


def test_filters_of_edges_do_not_bear_what_they_cannot_predict():
    for edge in EDGES:
        assert all(of(edge, air, task, "lost") == 1.0 for air in ("delay", "gone") for task in PLANE)
        assert point(edge, "outage", "corridor") == pytest.approx(9.0, abs=0.3)


def test_ga_rkf_is_the_one_for_all_else():
    assert all(count("ga-rkf") > count(who) for who in ("none", "rkf", "ral", "conral"))
    assert all(best("ga-rkf", air) for air in ("bursts", "wifi_busy", "mesh_2hop", "delay", "gone"))


def test_rkf_is_as_good_where_losses_are_independent_and_bears_nothing_that_lasts():
    assert best("rkf", "loss 0.5")
    assert [point("rkf", "outage", task) for task in PLANE] == pytest.approx([13.1, 13.1], abs=0.5)
    assert point("rkf", "outage", "ravine") == pytest.approx(6.4, abs=0.5)
    assert [point("rkf", "burst", task) for task in PLANE] == pytest.approx([6, 6], abs=0.5)


def test_imm_and_filters_of_edges_bear_the_most_losses_in_the_plane_and_imm_no_bursts():
    for task, most in (("corridor", ("imm",)), ("turns", EDGES)):
        rest = {*OTHERS, *EDGES} - {*most}
        assert all(point(one, "loss", task) > point(who, "loss", task) for one in most for who in rest)
        assert all(1 - point(one, "loss", task) == pytest.approx(1 / 7, abs=0.02) for one in most)
        assert not best("imm", "bursts", (task,))


def test_conral_is_as_good_where_losses_last():
    assert best("conral", "bursts")
    assert not best("conral", "loss 0.8", ("ravine",))


def test_ral_and_none_bear_no_losses_and_nobody_bears_nineteen_in_twenty():
    assert all(point(who, "loss", task) < 0.31 for who in ("none", "ral") for task in PLANE)
    assert point("silent-kf", "loss", "corridor") < 0.31
    lost = [each["lost"] for one in KEPT["cells"] if one["air"] == "loss 0.95" for each in one["entrants"].values()]
    assert min(lost) > 0.9


def test_covariances_are_too_small_as_often_as_it_says():
    assert too_small("ga-rkf") == pytest.approx(1 / 3, abs=0.06)
    assert too_small("conral") > 0.5
    assert all(too_small(edge) > 0.85 for edge in EDGES)


def test_every_card_that_is_shipped_is_on_the_page_of_scores():
    page = (DOCS / "score.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == ["edges", "faults", "places", "pursuit"]
    assert set(files.shipped("scorecards")) == {"edges", "faults", "places", "pursuit"}
