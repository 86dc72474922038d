"""From the network section to the air: selectors, profiles, traces, and what is said when they are wrong."""

import json

import numpy as np
import pytest
from flying import plan_of

from affinet.planning import making as planning
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading, profiles, selectors
from affinet.scenario.wrong import ScenarioError
from netem.faults.timeline import Timeline
from netem.medium.medium import Medium
from netem.medium.verdict import Verdict

CALM = ("network.availability=1.0", "time.duration=1")


def planned(*overrides):
    return planning.make(loading.load("corridor", (*CALM, *overrides)))


def says(*overrides):
    return [finding.says for finding in planned(*overrides).findings if finding.check == "air"]


def complaint(*overrides):
    with pytest.raises(ScenarioError) as caught:
        planned(*overrides)
    return str(caught.value)


@pytest.mark.parametrize(
    ("selector", "pairs"),
    [
        ("2->4", {(2, 4)}),
        ("4-2", {(2, 4), (4, 2)}),
        ("leaders->leaders", {(1, 2), (1, 3), (2, 1), (3, 1)}),
        ("6->leaders", {(6, 3)}),
        ("6", {(3, 6), (4, 6), (7, 6), (6, 3), (6, 4), (6, 7)}),
    ],
)
def test_selectors_name_links(selector, pairs):
    world = plan_of("corridor").world
    assert set(selectors.pairs([selector], world.formation, world.links)) == pairs


def test_all_names_every_link_once():
    world = plan_of("corridor").world
    assert len(selectors.pairs(["all", "leaders", "1-2"], world.formation, world.links)) == 24


def test_later_settings_of_a_link_win_and_are_said_class_by_class():
    said = says(
        'network.links=[{links="leaders",profile="wifi_busy"},{links="1-2",profile="perfect",availability=0.5}]'
    )
    assert [text.split(":")[0] for text in said] == [
        "2 links, profile 'perfect'",
        "14 links, profile 'wifi_busy'",
        "8 links, profile 'perfect'",
    ]
    assert "mean loss 0.5, mean burst 2 ticks" in said[0]


def test_sensing_and_communication_are_said_apart_when_they_are_decided_apart():
    sensing, comms = says("network.coupled=false", 'network.links=[{links="all",channels="sensing",availability=0.8}]')
    assert sensing == "24 links, profile 'perfect', sensing: mean loss 0.2, mean burst 1.25 ticks"
    assert comms.startswith("24 links, profile 'perfect', comms: mean loss 0, mean delay 0 s (0 ticks)")


def test_a_profile_takes_from_another_what_it_does_not_say():
    own = {"mine": profiles.LinkProfile.model_validate({"like": "acoustic", "loss": []})}
    found = profiles.resolve("mine", own)
    assert found.loss == []
    assert found.delay == profiles.presets()["acoustic"].delay


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (('network.links=[{links="1-7"}]',), "network.links.1.links: '1-7' matches no link"),
        (('network.links=[{links="1-9"}]',), "agent 9 does not exist"),
        (('network.links=[{links="them"}]',), "selects no links"),
        (('network.links=[{links="all",profile="nix"}]',), "network.links.1.profile: no profile 'nix'"),
        (('network.profiles.x.loss=[{model="gilbert",loss=0.1,burstt=2.0}]',), "loss.1.burstt: unknown key"),
        (("network.profiles.x.los=[]",), "did you mean 'loss'?"),
        (('network.profiles.x.loss=[{model="gauss"}]',), "needs a model among bernoulli, gilbert"),
        (("network.profiles.x.rate={rate=1e4,queue=10}", 'network.profile="x"'), "can never be delivered"),
        (
            (
                'network.profiles.x.loss=[{model="markov",p13=0.0,p31=0.1,p32=0.1,p23=0.1,p14=0.0}]',
                'network.profile="x"',
            ),
            "p13 and p14 are both 0",
        ),
        (('network.profile="nix"',), "no profile 'nix'; there are acoustic"),
        (('network.profiles.a.like="b"', 'network.profiles.b.like="a"', 'network.profile="a"'), "a -> b -> a"),
        (("network.availability=0.0",), "can never deliver"),
        (('network.profiles.x.loss=[{model="bernoulli",p=1.0}]', 'network.profile="x"'), "can never deliver"),
        (('network.profiles.x.loss=[{model="bernoulli",p=1.1}]',), "p: should be less than or equal to 1"),
        (('network.profiles.x.loss=[{model="gilbert",loss=0.8,burst=2.0}]',), "lose at most 0.6667"),
        (
            ('network.profiles.x.loss=[{model="gilbert-elliott",p=0.0,r=0.0}]', 'network.profile="x"'),
            "network.profiles.x: p and r are both 0",
        ),
        (('network.profiles.x.loss=[{model="ramp",inner=3.0,outer=1.0}]',), "beyond outer"),
        (('network.profiles.x.loss=[{model="disk",range=1.0},{model="ramp",inner=1.0,outer=2.0}]',), "at most one of"),
        (('network.profiles.x.delay={model="normal",mean=0.1}',), "is given by jitter and mean"),
        (
            ('network.profiles.x.delay={model="table",table=[0.2,-0.1]}',),
            "x.delay.table: give delays in seconds, at least 0",
        ),
        (('network.profiles.x.delay={model="table",table=[]}',), "x.delay.table: give delays in seconds, at least 0"),
        (
            ('network.profiles.x.delay={model="table",table=[inf]}',),
            "x.delay.table: give delays in seconds, at least 0",
        ),
        (
            ('network.profiles.x.delay={model="table",table=[true]}',),
            "x.delay.table: give delays in seconds, at least 0",
        ),
        (('network.profiles.x.delay={model="table",table=3}',), "x.delay.table: give delays in seconds, at least 0"),
        (('network.profiles.x.delay={model="constant",mean=-1.0}',), "greater than or equal to 0"),
        (('network.profiles.x.corrupt=[{kind="bias",p=0.1}]',), "give `by`"),
        (('network.profiles.x.corrupt=[{kind="nan",p=0.7},{kind="stale",p=0.7}]',), "add up to at most 1"),
        (("network.profiles.x.rate={rate=0.0}",), "greater than 0"),
        (('network.profiles.x.netem="loss 10% 25%"',), "loss gemodel"),
        (('network.profiles.x={netem="loss 10%",loss=[]}',), "given by netem and beside it"),
        (("network.zones=[{centre=[0.0,0.0,0.0],radius=1.0}]",), "network.zones.1.centre: needs 2 coordinates"),
        (('network.zones=[{centre=[0.0,0.0],radius=1.0,links="1-7"}]',), "network.zones.1.links"),
        (('network.zones=[{centre=[0.0,0.0],radius=1.0,channels="comms"}]',), "coupled = true"),
        (('network.links=[{links="all",channels="comms"}]',), "coupled = true gives sensing and comms one verdict"),
        (('timeline=[{verb="lose",at=0.1,links=["1-7"],loss=0.5}]',), "timeline.1.links: '1-7' matches no link"),
        (('timeline=[{verb="lose",at=0.1,links=["1-2"],loss=1.5}]',), "loss: should be less than or equal to 1"),
        (('timeline=[{verb="cut",at=0.1,links=["1-2"],in_flight="keep"}]',), "'drop', 'deliver' or 'hold'"),
    ],
)
def test_what_is_wrong_is_said(overrides, expected):
    assert expected in complaint(*overrides)


TRACED = ('network.profiles.t.loss=[{{model="trace",file="{}"}}]', 'network.profile="t"')


def traced(file):
    return (TRACED[0].format(file), TRACED[1])


HEADER = "time,src,dst,availability\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("time,src\n", "line 1: the columns must be"),
        (HEADER, "line 1: a heading and no row below it"),
        (HEADER + "0,1,2,0.5\n", "no availability at time 0 for"),
        (HEADER + "0,1,7,0.5\n", "1->7 is not a link"),
        (HEADER + "0,1,2,1.5\n", "line 2: time must be at least 0 s, and availability lie in [0, 1]"),
        (HEADER + "0,1,2,much\n", "four numbers are due"),
    ],
)
def test_what_is_wrong_in_a_trace_is_said(text, expected, tmp_path):
    (tmp_path / "trace.csv").write_text(text)
    assert expected in complaint(*traced(tmp_path / "trace.csv"))


def test_a_trace_is_flown(tmp_path):
    links = plan_of("corridor").world.links
    rows = [
        f"{at},{src},{dst},{share}" for src, dst in links.index for at, share in ((0, 1), (0.5, 0 if src == 4 else 1))
    ]
    (tmp_path / "trace.csv").write_text(HEADER + "\n".join(rows) + "\n")
    flown = rehearse(planned(*traced(tmp_path / "trace.csv"))).arrays
    expected = np.full((100, 4, 24), int(Verdict.DELIVERED))
    expected[50:, :, links.src == 4] = Verdict.LOST
    assert np.array_equal(flown["verdicts"], expected)


def test_the_losses_of_an_earlier_run_are_a_trace(tmp_path):
    lossy = planned("network.availability=0.6", 'timeline=[{verb="cut",at=0.2,until=0.4,links=["1-2"]}]')
    fly(lossy, "inprocess", tmp_path / "before", lambda *_: None)
    again = rehearse(planned(*traced(tmp_path / "before"), "seed=9")).arrays["verdicts"]
    lost = rehearse(lossy).arrays["verdicts"] == Verdict.LOST
    assert 0.3 < lost.mean() < 0.5
    assert np.array_equal(again == Verdict.LOST, lost)


def test_a_run_shorter_than_this_one_is_no_trace(tmp_path):
    fly(planned("time.duration=0.5"), "inprocess", tmp_path / "before", lambda *_: None)
    assert "the run ends after 0.5 s, this one after 1 s; shorten time.duration" in complaint(
        *traced(tmp_path / "before")
    )


def test_a_resolved_scenario_flies_the_same_air(tmp_path):
    plan = planned('network.profiles.x={like="wifi_busy",netem="duplicate 1%"}', 'network.profile="x"')
    first = fly(plan, "inprocess", tmp_path / "first", lambda *_: None)
    again = planning.make(loading.resolved(tmp_path / "first"))
    assert fly(again, "inprocess", tmp_path / "again", lambda *_: None).digest == first.digest
    told = json.loads((tmp_path / "first" / loading.FILE).read_text())
    assert told["network"]["profile"] == "x"


def over_time(tmp_path, what, values):
    """A table in which links from agent 4 are worth the second of two values from 0.5 s on."""
    links = plan_of("corridor").world.links
    rows = [f"{at},{src},{dst},{values[at > 0 and src == 4]}" for src, dst in links.index for at in (0, 0.5)]
    (tmp_path / "links.csv").write_text(f"time,src,dst,{what}\n" + "\n".join(rows) + "\n")
    return tmp_path / "links.csv", links


def test_delays_over_time_are_flown(tmp_path):
    file, links = over_time(tmp_path, "delay", (0.02, 0.05))
    profile = f'network.profiles.t.delay={{model="trace",trace={{file="{file}"}}}}'
    made = planned(profile, 'network.profile="t"')
    (slower,) = made.profiles[0].delay_traces
    assert slower.ticks.tolist() == [0, 50]
    verdicts = rehearse(made).arrays["verdicts"]
    assert (verdicts[:, 1:] == Verdict.DELAYED).all()
    told = [finding.says for finding in made.findings if finding.check == "air"]
    assert any("mean delay 0.02" in one for one in told)
    medium = Medium(1, ("sense", "a", "b", "c"), made.profiles, Timeline(links, ()))
    air, waits = medium.begin(), []
    for tick in range(60):
        air, ruled = medium.judge(air, tick, np.ones((4, len(links)), dtype=bool), None)
        air, _ = medium.deliver(air, tick, ruled)
        waits.append(ruled.due[1] - tick)
    assert (np.array(waits)[:50] == 2).all()
    assert (np.array(waits)[50:] == np.where(links.src == 4, 5, 2)).all()


def test_rates_over_time_are_flown(tmp_path):
    file, links = over_time(tmp_path, "rate", (1e9, 1e4))
    made = planned(
        f'network.profiles.t.rate={{trace={{file="{file}"}},queue=100000,burst=1000}}', 'network.profile="t"'
    )
    verdicts = rehearse(made).arrays["verdicts"]
    assert (verdicts[:50] == Verdict.DELIVERED).all()
    slow = verdicts[70:, 1:, links.src == 4]  # when what may pass at once has
    assert (slow != Verdict.DELIVERED).all()
    assert (verdicts[:, :, links.src != 4] == Verdict.DELIVERED).all()


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ('network.profiles.t.delay={{model="trace",trace={{file="{}"}}}}', "and no delay: name one that does"),
        ('network.profiles.t.rate={{trace={{file="{}"}}}}', "and no rate: name one that does"),
        ('network.profiles.t.rate={{trace={{file="none.csv"}},rate=1e6}}', "give a rate, or a trace of it"),
        ("network.profiles.t.rate={{queue=1000}}", "give a rate, or a trace of it"),
        ('network.profiles.t.delay={{model="trace"}}', "the model 'trace' is given by trace"),
        ('network.profiles.t.delay={{model="trace",trace={{file="none.csv"}}}}', "none.csv: no such file"),
    ],
)
def test_what_is_wrong_in_delays_and_rates_over_time_is_said(override, says, tmp_path):
    (tmp_path / "trace.csv").write_text(HEADER + "0,1,2,1\n")
    assert says in complaint(override.format(tmp_path / "trace.csv"), 'network.profile="t"')
