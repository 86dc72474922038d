"""What was recorded or measured, applied to a run: it fits, is converted with a note, or is refused in a line."""

import numpy as np
import pytest
from flying import plan_of

from affinet.cli import commands
from affinet.planning import making as planning
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from netem.core.links import Links
from netem.medium import journal, recorded
from netem.medium.medium import JOURNAL
from netem.medium.verdict import Verdict
from world.books import history

BEFORE = ("time.dt=0.01", "time.duration=1", "record.enabled=false", "network.availability=0.6")
HERE = ("time.duration=1", "network.availability=1.0")
HEXA = 'formation.preset="hexa10"'


def traced(file, *overrides):
    profile = f'network.profiles.t.loss=[{{model="trace",file="{file}"}}]'
    return planning.make(loading.load("corridor", [*HERE, profile, 'network.profile="t"', *overrides]))


def refused(file, *overrides):
    with pytest.raises(ScenarioError) as caught:
        traced(file, *overrides)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def notes(plan):
    return [finding.says for finding in plan.findings if finding.check == "trace"]


def worth(plan, ticks):
    (one,) = plan.profiles[0].traces
    return one.availability[np.searchsorted(one.ticks, np.arange(ticks), side="right") - 1]


def flown(out, *overrides):
    plan = plan_of("corridor", *BEFORE, *overrides)
    fly(plan, "inprocess", out, lambda *_: None)
    return plan, history.load(out / history.ARRAYS)["verdicts"]


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """A run of 100 ticks of 0.01 s, and what the air let pass in each, shape (T, L)."""
    out = tmp_path_factory.mktemp("recorded") / "before"
    _, verdicts = flown(out)
    return out, (verdicts[:, 0] == Verdict.DELIVERED).astype(float)


# ---- its clock


def test_at_its_own_clock_a_run_is_met_tick_by_tick(before):
    out, passed = before
    plan = traced(out, "time.dt=0.01")
    assert np.array_equal(worth(plan, 100), passed)
    assert notes(plan) == []


def test_at_a_coarser_clock_each_tick_has_its_mean(before):
    """Before: tick k of 0.05 s met the verdict of tick k of 0.01 s, so the first fifth of the run stood for all of it."""
    out, passed = before
    plan = traced(out, "time.dt=0.05")
    np.testing.assert_allclose(worth(plan, 20), passed.reshape(20, 5, -1).mean(axis=1), atol=1e-12)
    assert notes(plan) == [
        "profile 't': before: it was flown at dt 0.01 s, and this run has 0.05 s: each tick has its mean over time"
    ]


def test_at_a_finer_clock_each_verdict_holds(before):
    out, passed = before
    plan = traced(out, "time.dt=0.005")
    assert np.array_equal(worth(plan, 200), np.repeat(passed, 2, axis=0))


# ---- its length


def test_a_run_that_ended_before_is_refused_whatever_its_ticks(before):
    """Before: 100 ticks of 0.01 s were enough for 40 ticks of 0.05 s."""
    out, _ = before
    said = refused(out, "time.dt=0.05", "time.duration=2")
    assert "the run ends after 1 s, this one after 2 s; shorten time.duration" in said


def test_a_run_that_was_killed_is_worth_what_it_wrote(before, tmp_path):
    out, passed = before
    table = journal.read(out / JOURNAL)
    cut = tmp_path / "cut"
    cut.mkdir()
    (cut / "scenario.json").write_bytes((out / "scenario.json").read_bytes())
    whole = (out / JOURNAL).read_bytes()
    (cut / JOURNAL).write_bytes(whole[: len(whole) * 3 // 4])
    ticks = int(journal.read(cut / JOURNAL)["tick"].to_numpy().max()) + 1
    assert 0 < ticks < 100 == int(table["tick"].to_numpy().max()) + 1
    assert f"the run ends after {ticks * 0.01:g} s, this one after 1 s" in refused(cut, "time.dt=0.01")
    assert np.array_equal(worth(traced(cut, "time.dt=0.01", "time.duration=0.1"), 10), passed[:10])


@pytest.mark.parametrize(
    ("files", "says"),
    [
        pytest.param((), "the directory holds no journal.arrows: name that of a run, or a CSV file", id="no run"),
        pytest.param(("journal.arrows",), "no run directory: ", id="its clock is not known"),
        pytest.param(("journal.arrows", "scenario.json"), "the journal has no verdicts on sensing", id="empty"),
    ],
)
def test_a_directory_that_is_no_air_is_refused(files, says, before, tmp_path):
    """Before: an empty journal let everything pass."""
    out, _ = before
    if "scenario.json" in files:
        (tmp_path / "scenario.json").write_bytes((out / "scenario.json").read_bytes())
    if "journal.arrows" in files:
        journal.Writer(tmp_path / JOURNAL, plan_of("corridor").world.links, ["sense"], 50).close()
    assert says in refused(tmp_path)


# ---- its links


def test_links_of_which_it_says_nothing_are_refused(before):
    """Before: no row, no loss."""
    out, _ = before
    assert "before: the run has no verdict on 6->1, 3->2, " in refused(out, "time.dt=0.05", HEXA)


def test_of_a_larger_swarm_the_links_that_are_here_are_taken(tmp_path):
    """Before: one agent too many, and nothing of the journal counted: everything passed."""
    plan, verdicts = flown(tmp_path / "run", HEXA)
    both = [pair for pair in plan.world.links.index if max(pair) < 10 and min(pair) <= 2]
    links = Links.both_ways(9, both)
    carried = recorded.carried(journal.read(tmp_path / "run" / JOURNAL), links, sensing=True)
    rows = [plan.world.links.index[pair] for pair in links.index]
    assert np.array_equal(carried.share, verdicts[:, 0, rows] == Verdict.DELIVERED)
    assert carried.known.all()


def test_of_other_links_those_of_the_same_numbers_are_taken_with_a_note(before):
    out, passed = before
    edges = [edge for edge in plan_of("corridor").world.formation.edges if edge != (5, 7)]
    mine = [
        "formation={nodes=[[0.0,0.0],[1.0,1.0],[1.0,-1.0],[2.0,1.0],[2.0,-1.0],[3.0,1.0],[3.0,-1.0]],leaders=[1,2,3],"
        f"edges={[f'{i}-{j}' for i, j in edges]}}}",
        "agents.law='rest'",
        "manoeuvre.preset='hover'",
    ]
    plan = traced(out, "time.dt=0.01", *mine)
    here = [plan_of("corridor").world.links.index[pair] for pair in plan.world.links.index]
    assert np.array_equal(worth(plan, 100), passed[:, here])
    assert notes(plan) == [
        "profile 't': before: it was flown over other links (5->7, 7->5 are in one alone): they go by the agents' numbers"
    ]


def test_where_nothing_was_offered_or_a_fault_held_it_a_note_says_so(tmp_path):
    _, verdicts = flown(tmp_path / "run", 'timeline=[{verb="cut",at=0.2,until=0.45,links=["all"]}]')
    plan = traced(tmp_path / "run", "time.dt=0.01")
    assert (worth(plan, 100)[20:45] == 1.0).all()
    assert np.array_equal(worth(plan, 100) == 0.0, verdicts[:, 0] == Verdict.LOST)
    assert notes(plan) == [
        "profile 't': run: in 25.00% of its ticks and links nothing was offered, or a fault held it: there all passes"
    ]


def test_communication_is_worth_what_its_channels_carried(tmp_path):
    """Before: the channel that was first in the journal stood for all."""
    plan, verdicts = flown(tmp_path / "run", "network.coupled=false")
    assert len(plan.channels) > 2
    sensing, comms = traced(tmp_path / "run", "time.dt=0.01", "network.coupled=false").profiles[0].traces
    assert (sensing.sensing, comms.comms) == (True, True)
    carried = verdicts[:, 1:] == Verdict.DELIVERED
    at = np.searchsorted(comms.ticks, np.arange(100), side="right") - 1
    np.testing.assert_allclose(comms.availability[at], carried.mean(axis=1), atol=1e-12)


# ---- a CSV


def rows_of(pairs, *, at=0.0, worth=0.5):
    return "".join(f"{at},{src},{dst},{worth}\n" for src, dst in pairs)


@pytest.fixture
def csv(tmp_path):
    file = tmp_path / "trace.csv"
    file.write_text("time,src,dst,availability\n" + rows_of(plan_of("corridor").world.links.index))
    return file


def test_a_csv_that_ends_before_the_run_holds_its_last_values_with_a_note(csv):
    assert notes(traced(csv)) == [
        "profile 't': trace.csv: its last row is of 0 s, and each value holds to the end of the run (1 s)"
    ]


def test_a_csv_denser_than_the_clock_is_averaged_with_a_note(csv):
    csv.write_text(csv.read_text() + rows_of([(1, 2)], at=0.97, worth=1.0))
    plan = traced(csv, "time.dt=0.05")
    assert notes(plan) == [
        "profile 't': trace.csv: it changes within ticks of 0.05 s: each tick has its mean over time"
    ]
    assert worth(plan, 20)[-1, plan.world.links.index[1, 2]] == pytest.approx(0.8)


def test_a_degraded_link_alone_needs_rows(csv):
    """Before: a trace of the links that are degraded was refused for all the others."""
    csv.write_text("time,src,dst,availability\n0,1,2,0\n0,2,1,0\n")
    degrade = 'timeline=[{verb="degrade",at=0.5,links=["1-2"],profile="t"}]'
    plan = traced(csv, 'network.profile="perfect"', "time.dt=0.05", degrade)
    verdicts, links = rehearse(plan).arrays["verdicts"], plan.world.links
    lost = np.zeros((20, len(links)), dtype=bool)
    lost[10:, [links.index[1, 2], links.index[2, 1]]] = True
    assert np.array_equal(verdicts[:, 0] == Verdict.LOST, lost)
    assert notes(plan) == [
        "profile 't': trace.csv: its last row is of 0 s, and each value holds to the end of the run (1 s)"
    ]
    assert "no availability at time 0 for 2->1" not in str(plan.findings)
    csv.write_text("time,src,dst,availability\n0,1,2,0\n")
    said = refused(csv, 'network.profile="perfect"', degrade)
    assert said.endswith(f"trace {csv}: no availability at time 0 for 2->1")


def test_a_file_of_delays_is_drawn_from(tmp_path):
    (tmp_path / "pings.txt").write_text("1.0\n0.001\n0.002\n0.003\n0.004\n0.005\n0.006\n0.007\n0.008\n0.054\n")
    table = f'network.profiles.t.delay={{model="table",table="{tmp_path}/pings.txt"}}'
    plan = planning.make(loading.load("corridor", [*HERE, "time.duration=5", table, 'network.profile="t"']))
    (air,) = [finding.says for finding in plan.findings if finding.check == "air"]
    assert "mean delay 0.109 s" in air
    (law,) = plan.profiles[0].delays
    assert law.table.tolist() == [0.001, 0.002, 0.003, 0.004, 0.005, 0.006, 0.007, 0.008, 0.054, 1.0]


# ---- verdicts


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("time.dt=0.05", "time.dt: the verdicts are of a run with 0.01, not 0.05: leave it as it was"),
        (
            'time.exchange="next-tick"',
            "time.exchange: the verdicts are of a run with same-tick, not next-tick: leave it",
        ),
        (HEXA, "formation: the journal has no verdict on "),
        ("time.duration=2", "the journal ends after 100 ticks, the run has 200; shorten time.duration"),
    ],
)
def test_verdicts_are_of_the_ticks_and_links_of_their_run(change, says, before, tmp_path, capsys):
    """Before: they were applied by tick number, and what had none got through until the run failed in flight."""
    out, _ = before
    again = ["replay", "--verdicts", str(out), "--runtime", "inprocess", "--out", str(tmp_path / "again")]
    assert commands.main([*again, "--set", change]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert said.count("\n") == 1
    assert not (tmp_path / "again").exists()
