"""A score tells planted estimators apart, each for the right reason, and two that are equal not at all."""

import pytest
from planted_estimators import write

from affinet.score import card as cards
from affinet.score import judging, scoring
from affinet.score.card import Air, Scorecard, Task
from affinet.score.scoring import Kept
from affinet.studies.executor import Here
from analysis.claims.paired import Comparison

CARD = Scorecard(
    title="planted",
    seeds=12,
    quick_seeds=12,
    tasks=[
        Task(
            name="corridor",
            says="seven fly a corridor",
            scenario="corridor",
            set=["time.dt=0.05", "time.duration=15", "network.availability=1"],
            lost=1.0,
            recovered=0.4,
            noisier=["sensing.sigma=0.3"],
            rivals=["rkf"],
            quick=True,
        )
    ],
    airs=[
        Air(name="perfect", says="nothing is lost", quick=True),
        Air(name="lossy", says="every other message is lost", set=["network.availability=0.5"], quick=True),
    ],
    worsenings=[
        cards.Worsening(name="loss", says="the share lost", set=["network.availability={rest}"], most=0.99, quick=True)
    ],
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("planted")
    write(where)
    return where


@pytest.fixture(scope="module")
def scored(folder):
    """The score of one of them against others."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))

        def score(name, *against, worsenings=(), **of_task):
            tasks = [task.model_copy(update=of_task) for task in CARD.tasks]
            worse = [one for one in CARD.worsenings if one.name in worsenings]
            card = CARD.model_copy(update={"tasks": tasks, "worsenings": worse})
            called = [f"planted_here:{one}" if one[0].isupper() else one for one in (name, *against)]
            who = scoring.entrants(card, called[0], called[1:], laws=False)
            todo = [one for one in scoring.pieces(card, who, "agents.estimator", folder) if one.kind != "timed"]
            kept = Kept(folder, dict.fromkeys(called, "planted"), pytest.fail)
            raw = scoring.together(card, who, todo, scoring.fly(todo, Here(), kept, lambda _: None))
            return raw, judging.judge(raw)

        yield score


def decisions(score):
    return {(one.air, one.rival.rpartition(":")[2]): one.decision for one in score.compared}


def said(score, part):
    return [one for one in score.words if part in one]


def test_two_that_are_equal_are_no_different(scored):
    _, score = scored("Good", "rkf", worsenings=["loss"])
    assert set(decisions(score).values()) == {Comparison.SAME}
    assert {one.decision for one in score.break_downs if one.entrant == "rkf"} == {Comparison.SAME}
    assert not said(score, "overconfident")
    assert not said(score, "do not depend")


def test_one_that_ignores_losses_is_as_good_where_nothing_is_lost_and_worse_where_much_is(scored):
    _, score = scored("Truthful", "Good", worsenings=["loss"])
    assert decisions(score) == {("perfect", "Good"): Comparison.SAME, ("lossy", "Good"): Comparison.WORSE}
    own, good = (next(one for one in score.break_downs if one.entrant.endswith(name)) for name in ("Truthful", "Good"))
    assert own.median.high < good.median.low
    assert good.decision is Comparison.WORSE
    assert not said(score, "overconfident")
    assert not said(score, "do not depend")


def test_one_that_is_overconfident_by_a_fifth_is_told_so_and_its_truthful_twin_is_not(scored):
    _, score = scored("Overconfident", "Truthful")
    assert set(decisions(score).values()) == {Comparison.SAME}
    (sentence,) = said(score, "overconfident")
    assert sentence.startswith("corridor: overconfident in 2 of 2 airs (perfect, lossy): squared errors are 1.2")
    assert not said(scored("Truthful", "Good")[1], "overconfident")


def test_one_that_is_told_where_its_neighbours_are_does_not_depend_on_its_sensors(scored):
    raw, score = scored("Leaking", "Truthful")
    assert raw.runs("corridor", "perfect", raw.scored, "estimation").max() < 0.05
    (sentence,) = said(score, "do not depend on its sensors")
    assert "it knows what it has not measured" in sentence
    for honest in ("Good", "Truthful", "Overconfident"):
        assert not said(scored(honest, "rkf")[1], "do not depend")


def test_sensors_that_are_worse_to_nobody_accuse_nobody(scored):
    _, score = scored("Leaking", "Truthful", noisier=["sensing.sigma=0.1"])
    assert not said(score, "do not depend")


def test_one_that_is_lost_at_all_that_is_tried_breaks_down_below_it(scored):
    _, score = scored("Good", "rkf", worsenings=["loss"], lost=0.01, recovered=0.01)
    assert [one.median.found for one in score.break_downs] == [0.0, 0.0]
    (sentence,) = said(score, "half of the swarms")
    assert sentence.startswith(
        "corridor, loss: half of the swarms are lost at below 0.0155; with rkf at below 0.0155 ("
    )


def test_one_that_suits_no_task_says_why(scored):
    raw, score = scored("target", "rkf")
    assert not raw.flies("corridor", "target")
    assert score.compared == ()
    assert said(score, "corridor: target does not suit it: ")


def test_an_air_in_which_a_fault_touches_nothing_decides_nothing(folder, monkeypatch):
    monkeypatch.syspath_prepend(str(folder))
    late = Air(
        name="late", says="after the end", set=['timeline=[{verb="cut",at=60,lasts=1,links=["all"]}]'], quick=True
    )
    card = CARD.model_copy(update={"airs": [*CARD.airs, late], "worsenings": []})
    who = scoring.entrants(card, "rkf", ["none"], laws=False)
    todo = [one for one in scoring.pieces(card, who, "agents.estimator", folder) if one.kind != "timed"]
    kept = Kept(folder, dict.fromkeys(("rkf", "none"), "planted"), pytest.fail)
    score = judging.judge(scoring.together(card, who, todo, scoring.fly(todo, Here(), kept, lambda _: None)))
    assert {one.air for one in score.compared} == {"perfect", "lossy"}
    assert said(score, "corridor, late: in all runs a fault touched nothing, which proves nothing")
