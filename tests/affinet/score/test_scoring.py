"""A score as one has it: every run is the run alone, what has flown does not fly again, file and page say what came out."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from own_code import ESTIMATOR, broken, write

from affinet.cli.commands import main
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import files, loading
from affinet.score import card as cards
from affinet.score import flying, measures, scoring
from affinet.score.card import Task, Worsening
from affinet.score.flying import Cell, Descent, Entrant
from affinet.score.scoring import Kept
from affinet.studies.executor import Here

CARD = """\
title = "mine <b>"
seeds = 3
quick_seeds = 2
[[tasks]]
name = "corridor"
says = "seven fly"
scenario = "corridor"
set = ["time.dt=0.05", "time.duration=2"]
lost = 1.0
recovered = 0.4
noisier = ["sensing.sigma=0.3"]
rivals = ["rkf"]
laws = ["static"]
quick = true
[[airs]]
name = "cut"
says = "for half a second"
set = ['timeline=[{verb="cut",at=0.5,lasts=0.5,links=["all"]}]']
quick = true
[[worsenings]]
name = "loss"
says = "lost"
set = ["network.availability={rest}"]
most = 0.9
quick = true
"""
TASK = Task(
    name="corridor",
    says="",
    scenario="corridor",
    set=["time.dt=0.05", "time.duration=2"],
    lost=1.0,
    recovered=0.4,
)
LOSS = Worsening(name="loss", says="", set=["network.availability={rest}"], most=0.96)


def cell(name, *air, seeds=(1, 2, 3)):
    return Cell(TASK, "air", air, Entrant("agents.estimator", name, "."), seeds, ".")


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("affinet.cli.scoring.pool.on_this_machine", lambda _: Here())
    (tmp_path / "mine.toml").write_text(CARD)
    return tmp_path


def scored(capsys, *words):
    status = main(["score", *words, "--card", "mine.toml", "--json"])
    out, err = capsys.readouterr()
    return status, json.loads(out.splitlines()[-1]) if status == 0 else None, err


def test_what_is_measured_is_that_of_the_run_alone():
    cut = 'timeline=[{verb="cut",at=0.5,lasts=0.5,links=["all"]}]'
    flown = flying.cell(cell("rkf", cut))
    for number, plan in enumerate(cell("rkf", cut).plans((1, 2, 3))):
        run = rehearse(plan)
        assert {name: values[number] for name, values in flown.runs.items()} == pytest.approx(
            {name: float(value) for name, value in measures.of(run, TASK)._asdict().items()}, nan_ok=True
        )
        assert flown.runs["error"][number] == pytest.approx(np.sqrt(run.error.mean()))
        assert flown.runs["lost"][number] == (np.sqrt(run.error[-4:].mean()) > 1.0)
        above = np.flatnonzero(np.sqrt(run.error[20:]) >= 0.4)
        expected = 0.0 if not len(above) else np.inf if above[-1] == 19 else (above[-1] + 1) * 0.05
        assert flown.runs["recovery"][number] == pytest.approx(expected)
    assert np.isnan(flying.cell(cell("rkf")).runs["recovery"]).all()


def test_a_break_down_point_parts_runs_that_are_lost_from_those_that_are_not():
    longer = cell("none", "time.duration=10")
    points = flying.descent(Descent(longer, LOSS))
    half = LOSS.most / 2**7
    for seed, point in zip((1, 2, 3), points, strict=True):
        assert half < point < LOSS.most
        for worse, lost in ((point - half, False), (point + half, True)):
            (plan,) = longer.plans([seed], LOSS.at(worse))
            assert measures.of(rehearse(plan), TASK).lost == lost
    harmless = LOSS.model_copy(update={"most": 0.01})
    assert flying.descent(Descent(cell("rkf"), harmless)) == [np.inf] * 3


def test_what_has_flown_does_not_fly_again(place, capsys, monkeypatch):
    flown, fly = [], flying.cell
    monkeypatch.setattr("affinet.score.scoring.flying.cell", lambda given: flown.append(given) or fly(given))
    status, first, _ = scored(capsys, "none", "--quick")
    assert (status, first["scored"], first["against"], first["size"], first["seeds"]) == (
        0,
        "none",
        ["rkf"],
        "quick",
        2,
    )
    assert len(flown) == 4
    _, again, err = scored(capsys, "none", "--quick")
    assert len(flown) == 4
    assert "6 of 8 pieces were there" in err
    assert {**again, "verdict": [], "times": []} == {**first, "verdict": [], "times": []}
    # Of a piece that is gone, or of other seeds, what is missing flies.
    next(iter((place / "scores" / "none-quick" / "pieces").iterdir())).unlink()
    assert "5 of 8 pieces were there" in scored(capsys, "none", "--quick")[2]
    assert scored(capsys, "none")[1]["seeds"] == 3


@pytest.mark.parametrize(
    "damage",
    [
        lambda kept, _: kept[:-9],
        lambda _, __: b"",
        lambda _, __: b"[[], null]",
        lambda kept, _: kept.replace(b"1", b"2", 1),
        lambda _, other: other,
    ],
    ids=["cut", "empty", "none of ours", "edited", "of another"],
)
def test_a_piece_that_is_not_whole_is_named_and_flies_anew(place, capsys, damage):
    _, first, _ = scored(capsys, "none", "--quick")
    one, other = sorted((place / "scores" / "none-quick" / "pieces").iterdir())[:2]
    one.write_bytes(damage(one.read_bytes(), other.read_bytes()))
    status, again, err = scored(capsys, "none", "--quick")
    assert (status, again["cells"], again["break_downs"]) == (0, first["cells"], first["break_downs"])
    assert f"{one.name} is not whole: it flies anew" in err
    assert "5 of 8 pieces were there" in err
    assert "6 of 8 pieces were there" in scored(capsys, "none", "--quick")[2]


@pytest.mark.parametrize("damage", ["", "{", "[]", "{}"])
def test_a_result_that_cannot_be_read_is_not_written_over(place, capsys, damage):
    assert scored(capsys, "none", "--quick")[0] == 0
    (place / "scores" / "none-quick" / "score.json").write_text(damage)
    status, _, err = scored(capsys, "none", "--quick")
    assert status != 0
    assert "score.json: not what a score wrote there" in err
    assert len(err.splitlines()) == 1


def test_what_a_card_calls_its_airs_and_says_of_them_flies_nothing_anew(place, capsys):
    assert scored(capsys, "none", "--quick")[0] == 0
    (place / "mine.toml").write_text(CARD.replace("for half a second", "nobody hears").replace('"cut"\n', '"torn"\n'))
    assert "6 of 8 pieces were there" in scored(capsys, "none", "--quick")[2]


def test_a_file_that_a_scenario_reads_flies_anew_when_it_says_something_else(place, capsys):
    contacts = place / "contacts.txt"
    contacts.write_text("1 2 0 5\n")
    trace = 'loss=[{model="trace",file="contacts.txt",format="intervals"}]'
    own = f"""set = ['network.profile="own"', 'network.profiles.own={{{trace}}}']"""
    (place / "mine.toml").write_text(re.sub(r"set = .'timeline.*", own, CARD))
    assert scored(capsys, "none", "--quick")[0] == 0
    assert "6 of 8 pieces were there" in scored(capsys, "none", "--quick")[2]
    contacts.write_text("1 3 0 5\n")
    assert "2 of 8 pieces were there" in scored(capsys, "none", "--quick")[2]  # the break-downs


@pytest.mark.parametrize("name", files.shipped("scorecards"))
def test_what_flies_is_known_of_every_piece_of_a_card_that_is_shipped(tmp_path, name):
    card = cards.load(name)
    kept = Kept(tmp_path, {"mine": "code"}, pytest.fail)
    todo = list(scoring.pieces(card, {task.name: ["mine"] for task in card.tasks}, "agents.estimator", tmp_path))
    assert kept.read(todo) == {}
    assert len({kept._file(piece) for piece in todo}) == len(todo)


def test_a_scenario_file_that_says_something_else_flies_anew(place, capsys):
    own = loading.to_toml(loading.load("corridor"))
    (place / "own.toml").write_text(own)
    (place / "mine.toml").write_text(CARD.replace('scenario = "corridor"', 'scenario = "own.toml"'))
    assert scored(capsys, "none", "--quick")[0] == 0
    assert "6 of 8 pieces were there" in scored(capsys, "none", "--quick")[2]
    (place / "own.toml").write_text(own.replace("sigma = 0.1", "sigma = 0.2"))
    assert "2 of 8 pieces were there" in scored(capsys, "none", "--quick")[2]  # those with a sigma of the card's


def test_the_file_and_the_page_have_what_came_out(place, capsys):
    _, said, _ = scored(capsys, "none", "--quick")
    (compared,) = said["compared"]
    errors = {one["entrant"]: np.array(one["runs"]["error"]) for one in said["cells"] if one["air"] == "cut"}
    assert compared["factor"]["found"] == pytest.approx(np.exp(np.log(errors["none"] / errors["rkf"]).mean()))
    assert {one["entrant"] for one in said["break_downs"]} == {"none", "rkf"}
    assert [one["entrant"] for one in said["noisier"]] == ["none", "rkf"]
    assert {one["entrant"] for one in said["times"]} == {"none", "rkf"}
    assert json.loads((place / "scores/none-quick/score.json").read_text()) == said
    page = (place / "scores/none-quick/score.html").read_text()
    assert "mine &lt;b&gt;" in page
    assert "<b>" not in page
    for sentence in said["verdict"]:
        assert sentence.split(":")[0] in page


def test_another_code_of_ones_own_flies_anew_and_the_others_do_not(place, capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(place))
    name = write(place, ESTIMATOR)
    words = (f"{name}:Own", "--against", "rkf", "--quick", "--out", "here")
    assert scored(capsys, *words)[0] == 0
    (place / f"{name}.py").write_text(broken(ESTIMATOR, ("late = np", "later = np")))
    left = "3 of 8 pieces were there"  # the other's cells and its break-down
    assert left in scored(capsys, *words)[2]
    (place / "late.py").write_text("")  # which it may import as it flies
    assert left in scored(capsys, *words)[2]


@pytest.mark.parametrize(("one", "other"), [("crkf", "rkf"), ("rkf", "crkf")])
def test_one_that_does_not_suit_an_air_is_judged_in_the_others(place, capsys, one, other):
    """Before, the score ended with the error of that air, after all else had flown."""
    gone = """[[airs]]
name = "gone"
says = "one dies"
set = ['timeline=[{verb="kill",at=1,agents=[5]}]']
quick = true
"""
    (place / "mine.toml").write_text(CARD.replace("[[worsenings]]", f"{gone}[[worsenings]]"))
    status, said, _ = scored(capsys, one, "--against", other, "--quick")
    assert status == 0
    assert [compared["air"] for compared in said["compared"]] == ["cut"]
    unsuited = {(cell["entrant"], cell["air"]) for cell in said["cells"] if cell["unsuited"]}
    assert unsuited == {("crkf", "gone")}
    told = [sentence for sentence in said["verdict"] if "does not suit it" in sentence]
    assert [sentence.partition(" does")[0] for sentence in told] == (["corridor, gone: crkf"] if one == "crkf" else [])


@pytest.mark.usefixtures("place")
def test_a_law_is_scored_likewise(capsys):
    _, said, _ = scored(capsys, "varying-velocity", "--law", "--quick")
    assert (said["scored"], said["against"], said["noisier"]) == ("varying-velocity", ["static"], [])


@pytest.mark.usefixtures("place")
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("nobody",), "nobody suits none of the tasks: override: agents.estimator: no 'nobody'"),
        (("target",), "target suits none of the tasks: "),
        (("rkf", "--against", "nobody"), "nobody suits none of the tasks: override: agents.estimator: no 'nobody'"),
        (("rkf", "--card", "no.toml"), "no.toml: no such file, and no such scorecard"),
    ],
)
def test_what_cannot_be_scored_is_one_line(capsys, words, says):
    assert main(["score", "--card", "mine.toml", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(says)


def test_one_that_reports_something_else_does_not_suit_a_task():
    says = "what it reports is not what the task is about"
    assert flying.unsuited(cell("jor")).startswith(says)
    assert flying.unsuited(cell("rkf")) is None
    places = replace(cell("rkf"), task=TASK.model_copy(update={"scenario": "localization", "set": []}))
    assert flying.unsuited(places).startswith(says)
    assert flying.unsuited(replace(places, entrant=Entrant("agents.estimator", "jor", "."))) is None
    assert flying.timed(cell("jor")) is None
    assert flying.descent(Descent(cell("jor"), LOSS)) == []


def test_a_run_in_which_an_estimate_is_no_number_is_lost(place, monkeypatch):
    monkeypatch.syspath_prepend(str(place))
    name = write(
        place, broken(ESTIMATOR, ("Estimate(state.measured,", "Estimate(np.where(late, np.nan, state.measured),"))
    )
    entrant = Entrant("agents.estimator", f"{name}:Own", str(place))
    flown = flying.cell(replace(cell("none", "agents.law=rest"), entrant=entrant))
    assert (flown.runs["error"], flown.runs["lost"]) == ([np.inf] * 3, [1.0] * 3)


def test_an_air_that_no_task_can_be_flown_through_is_an_error(place, capsys):
    (place / "mine.toml").write_text(CARD.replace('verb="cut"', 'verb="cutt"'))
    assert main(["score", "none", "--quick", "--card", "mine.toml"]) == 2
    assert "cutt" in capsys.readouterr().err


@pytest.mark.usefixtures("place")
def test_a_directory_of_another_score_is_left_alone(capsys):
    assert scored(capsys, "none", "--quick", "--out", "here")[0] == 0
    assert main(["score", "rkf", "--quick", "--card", "mine.toml", "--out", "here"]) == 2
    assert "holds the quick score of none; name another directory" in capsys.readouterr().err
