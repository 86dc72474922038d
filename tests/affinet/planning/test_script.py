"""The timeline of a file becomes faults in ticks: when they begin, when they end, and what is refused."""

import numpy as np
import pytest

from affinet.planning import making
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from netem.faults.fault import Fault, UnderWay, Verb
from netem.faults.timeline import Timeline
from netem.faults.trigger import Trigger

HEAD = """\
seed = 1
[formation]
preset = "zhao7"
[manoeuvre]
preset = "hover"
[time]
dt = 0.05
duration = 2.0
[sensing]
sigma = 0.1
[agents]
estimator = "rkf"
law = "static"
[agents.parameters.static]
alpha = 1.0
"""
LINE = len(HEAD.splitlines())  # the first entry stands below


@pytest.fixture
def made(tmp_path):
    """The plan of a scenario with this timeline, from a file; each entry is the text of its keys."""

    def make(*entries, head=HEAD):
        file = tmp_path / "told.toml"
        file.write_text(head + "".join(f"[[timeline]]\n{keys.strip()}\n" for keys in entries))
        return making.make(loading.load(str(file)))

    return make


@pytest.fixture
def spans(made):
    """The first tick of every fault of such a scenario, its last but one, and the trigger from which they count."""
    return lambda *entries: [(fault.start, fault.end, fault.trigger) for fault in made(*entries).faults]


@pytest.fixture
def refused(made):
    """Why such a scenario is refused: the line, 1 that of the last entry's header; the key; and what would be right."""

    def refuse(*entries):
        with pytest.raises(ScenarioError) as error:
            made(*entries)
        (line,) = str(error.value).splitlines()
        file, number, key, says = line.split(":", 3)
        assert file == "told.toml"
        above = LINE + sum(len(entry.strip().splitlines()) + 1 for entry in entries[:-1])
        return int(number) - above, key.strip(), says.strip()

    return refuse


CUT = 'verb = "cut"\nlinks = ["2->4"]\n'
GUST = 'verb = "gust"\nagents = [5]\nvelocity = [1.0, 0.0]\n'
KILL = 'verb = "kill"\nagents = [5]\n'
RESTART = 'verb = "restart"\nagents = [5]\n'
PAUSE = 'verb = "pause"\nagents = [5]\n'
RESUME = 'verb = "resume"\nagents = [5]\n'
DEPART = 'verb = "depart"\nagents = [5]\n'
REJOIN = 'verb = "rejoin"\nagents = [5]\n'
HEAL = 'verb = "heal"\n'
WHEN = "when = { tracking_error_below = 0.5 }\n"


# ---- times


@pytest.mark.parametrize(
    ("times", "span"),
    [
        ("at = 0.5", (10, None)),
        ("at = 0", (0, None)),
        ("at = 0.5\nuntil = 0.75", (10, 15)),
        ("at = 0.5\nlasts = 0.75", (10, 25)),
        ("at = 0.51\nlasts = 0.02", (10, 11)),  # to the nearest tick, both
        ("at = 1.9\nlasts = 5.0", (38, 138)),
    ],
)
def test_times_are_seconds_from_the_start(times, span, spans):
    assert spans(CUT + times) == [(*span, None)]


@pytest.mark.parametrize(
    ("times", "starts"),
    [
        ("after = 'first'", 10),
        ("after = 'first'\nat = 0.2", 14),
        ("after = 'first.end'", 15),
        ("after = 'first.end'\nat = 0.2", 19),
    ],
)
@pytest.mark.parametrize("length", ["until = 0.75", "lasts = 0.25"])
def test_an_entry_begins_after_another_or_after_its_end(times, length, starts, spans):
    first, second = CUT + f"name = 'first'\nat = 0.5\n{length}", GUST + times + "\nlasts = 0.1"
    assert spans(first, second) == [(10, 15, None), (starts, starts + 2, None)]
    assert spans(second, first) == [(starts, starts + 2, None), (10, 15, None)]  # wherever they stand


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_entries_begin_after_each_other_in_a_chain(order, spans):
    chain = [
        CUT + "name = 'a'\nat = 0.1\nlasts = 0.2",
        GUST + "name = 'b'\nafter = 'a.end'\nat = 0.1\nlasts = 0.3",
        DEPART + "name = 'c'\nafter = 'b.end'\nlasts = 0.1",
    ]
    assert sorted(spans(*(chain[n] for n in order))) == [(2, 6, None), (8, 14, None), (14, 16, None)]


def test_after_what_comes_again_means_after_the_first_time(spans):
    again = CUT + "name = 'a'\nat = 0.2\nevery = 0.5\nlasts = 0.1\ntimes = 3"
    assert spans(again, GUST + "after = 'a.end'")[-1] == (6, None, None)


def test_what_has_no_other_time_than_after_needs_no_at(spans):
    assert spans(KILL + "name = 'k'\nat = 0.5", RESTART + "after = 'k'\nat = 0.25") == [(10, 15, None)]


@pytest.mark.parametrize(
    ("times", "starts"),
    [
        ("at = 0.2\nevery = 0.5\nlasts = 0.1\ntimes = 3", [4, 14, 24]),
        ("at = 0.2\nevery = 0.5\nlasts = 0.1\ntimes = 1", [4]),
        ("at = 0.2\nevery = 0.5\nlasts = 0.1", [4, 14, 24, 34]),  # to the end of the run
        ("at = 1.0\nevery = 0.5\nlasts = 0.5", [20, 30]),  # not in the tick after the last
        ("at = 1.6\nevery = 0.3\nlasts = 0.1\ntimes = 4", [32, 38]),
    ],
)
def test_what_comes_again_does_so_until_it_was_there_often_enough_or_the_run_is_over(times, starts, spans):
    assert [start for start, *_ in spans(GUST + times)] == starts


@pytest.mark.parametrize("times", ["at = 0.2\nevery = 0.3", "at = 0.18\nevery = 0.36"])
def test_what_comes_again_comes_no_more_when_the_run_is_over(times, made):
    built = made(GUST + times + "\nlasts = 0.1")
    assert max(fault.start for fault in built.faults) < built.world.ticks


def test_each_time_it_lasts_as_long(spans):
    assert spans(GUST + "at = 0.2\nevery = 0.5\nlasts = 0.25\ntimes = 2") == [(4, 9, None), (14, 19, None)]


def test_deaths_and_restarts_may_come_again_and_again(spans):
    assert spans(KILL + "at = 0.2\nevery = 0.6\ntimes = 2", RESTART + "at = 0.4\nevery = 0.6\ntimes = 2") == [
        (4, 8, None),
        (16, 20, None),
    ]


# ---- conditions


@pytest.mark.parametrize(
    ("when", "trigger"),
    [
        ("tracking_error_below = 0.5", Trigger(0.5, above=False, ticks=1)),
        ("tracking_error_above = 0.5", Trigger(0.5, above=True, ticks=1)),
        ("tracking_error_above = 0.0", Trigger(0.0, above=True, ticks=1)),
        ("tracking_error_below = 0.5, lasting = 0.5", Trigger(0.5, above=False, ticks=10)),
        ("tracking_error_above = 0.5, lasting = 0.01", Trigger(0.5, above=True, ticks=1)),
    ],
)
def test_a_condition_is_a_level_of_the_tracking_error_for_some_time(when, trigger, made):
    assert made(GUST + f"when = {{ {when} }}").triggers == (trigger,)


@pytest.mark.parametrize(
    ("trigger", "errors", "fires"),
    [
        (Trigger(1.0, above=False, ticks=2), [0.5], False),
        (Trigger(1.0, above=False, ticks=2), [0.5, 0.5], True),
        (Trigger(1.0, above=False, ticks=2), [0.5, 1.5, 0.5], False),
        (Trigger(1.0, above=False, ticks=2), [1.5, 0.5, 0.5], True),
        (Trigger(1.0, above=False, ticks=1), [1.0], False),
        (Trigger(1.0, above=True, ticks=1), [1.0], False),
        (Trigger(1.0, above=True, ticks=2), [1.5, 1.5], True),
        (Trigger(1.0, above=True, ticks=2), [1.5, 0.5], False),
        (Trigger(1.0, above=True, ticks=1), [float("nan")], False),
    ],
)
def test_a_trigger_fires_once_the_error_was_beyond_its_level_in_every_tick(trigger, errors, fires):
    assert trigger.fires(np.array(errors)) == fires


def test_what_waits_counts_from_the_tick_in_which_its_condition_comes(made):
    built = made(GUST + WHEN + "at = 0.1\nlasts = 0.2")
    assert built.faults == (Fault(Verb.GUST, 2, 6, trigger=0, agents=(5,), vector=(1.0, 0.0)),)
    assert not built.timeline.at(3).push.any()
    fired = built.timeline.fired([0], 7)
    assert [tick for tick in range(40) if fired.at(tick).push.any()] == [9, 10, 11, 12]
    assert (built.timeline.pending, fired.pending) == ((0,), ())


def test_entries_after_one_that_waits_wait_for_the_same(made):
    built = made(GUST + WHEN + "name = 'a'\nat = 0.1\nlasts = 0.2", CUT + "after = 'a.end'\nlasts = 0.5", KILL + WHEN)
    assert [(fault.start, fault.end, fault.trigger) for fault in built.faults] == [(2, 6, 0), (6, 16, 0), (0, None, 1)]
    assert len(built.triggers) == 2


def test_what_waits_may_come_again(spans):
    assert spans(GUST + WHEN + "every = 0.5\nlasts = 0.1\ntimes = 2") == [(0, 2, 0), (10, 12, 0)]


# ---- what times are refused

REFUSED_TIMES = [
    (CUT, "says not when: give at (s), after (the name of another entry), or when (a condition)"),
    (CUT + "lasts = 1.0", "says not when"),
    (CUT + "after = 'a'\n" + WHEN, "give after, or when, not both"),
    (CUT + "at = 0.5\ntimes = 3", "times says how often; give every (s) as well"),
    (KILL + "at = 0.5\ntimes = 3", "times says how often; give every (s) as well"),
    (CUT + "at = 0.5\nuntil = 0.7\nlasts = 0.2", "give until, or lasts, not both"),
    (CUT + "after = 'a'\nuntil = 0.7", "until is a time of the run; with after, when or every say how long it lasts"),
    (CUT + WHEN + "until = 0.7", "until is a time of the run"),
    (CUT + "at = 0.2\nevery = 0.5\nuntil = 0.7", "until is a time of the run"),
    (CUT + "at = 0.5\nuntil = 0.5", "ends at 0.5 s, but begins at 0.5 s; until must be later"),
    (CUT + "at = 0.5\nevery = 0.5", "what comes back every so many seconds lasts no longer than that: give lasts"),
    (CUT + "at = 0.5\nevery = 0.5\nlasts = 0.6", "lasts no longer than that"),
    (CUT + "after = 'b'", "after 'b': name one entry, or its end as 'b.end'; 0 are called 'b'"),
    (CUT + "after = 'a.start'", "after 'a.start': name one entry"),
    (CUT + "after = ''", "0 are called ''"),
    (CUT + "after = 'a.end'", "'a' says itself neither until when nor how long it lasts"),
    (CUT + "name = 'c'\nafter = 'c'", "entries begin after each other in a circle"),
]


@pytest.mark.parametrize(("entry", "says"), REFUSED_TIMES, ids=[row[1] for row in REFUSED_TIMES])
def test_an_entry_that_says_not_when_or_too_often_is_refused(entry, says, refused):
    first = GUST + "name = 'a'\nat = 0.2"
    line, key, why = refused(first, entry)
    assert (line, key) == (1, "timeline.2")
    assert says in why


REFUSED_KEYS = [
    ("at = -0.1", "at", "greater than or equal to 0"),
    ("at = inf", "at", "finite"),
    ("at = 0.1\nlasts = 0", "lasts", "greater than 0"),
    ("at = 0.1\nlasts = 0.1\nevery = 0", "every", "greater than 0"),
    ("at = 0.1\nlasts = 0.1\nevery = 1\ntimes = 0", "times", "greater than or equal to 1"),
    ("at = 0.1\nlasts = 0.1\nevery = 1\ntimes = 1.5", "times", "should be a whole number, like 1, got 1.5"),
    ("when = { tracking_error_below = 0 }", "when.tracking_error_below", "greater than 0"),
    ("when = { tracking_error_above = -1 }", "when.tracking_error_above", "greater than or equal to 0"),
    ("when = { tracking_error_below = 1, lasting = -1 }", "when.lasting", "greater than or equal to 0"),
    ("when = { tracking_eror_below = 1 }", "when.tracking_eror_below", "did you mean 'tracking_error_below'?"),
    ("when = { lasting = 1 }", "when", "give tracking_error_below, or tracking_error_above"),
    ("when = { tracking_error_below = 1, tracking_error_above = 1 }", "when", "give tracking_error_below, or"),
]


@pytest.mark.parametrize(("times", "key", "says"), REFUSED_KEYS, ids=[row[0] for row in REFUSED_KEYS])
def test_a_time_that_is_none_is_named_by_its_key_and_line(times, key, says, refused):
    line, named, why = refused(GUST + times)
    assert named == f"timeline.1.{key}"
    word = key.partition(".")[0]
    assert line == next(n for n, text in enumerate((GUST + times).splitlines(), 2) if text.startswith(f"{word} ="))
    assert says in why


def test_circles_are_refused_however_long_they_are(refused):
    entries = [CUT + f"name = '{name}'\nafter = '{after}'\nlasts = 0.1" for name, after in ("ab", "bc", "ca")]
    assert "in a circle" in refused(*entries)[2]


def test_a_name_that_two_entries_have_is_no_time(refused):
    twice = CUT + "name = 'a'\nat = 0.1"
    assert refused(twice, twice, GUST + "after = 'a'")[1:] == (
        "timeline.3",
        "after 'a': name one entry, or its end as 'a.end'; 2 are called 'a'",
    )


# ---- ends


@pytest.mark.parametrize(("begin", "end"), [(KILL, RESTART), (PAUSE, RESUME), (DEPART, REJOIN)])
def test_what_began_is_ended(begin, end, spans):
    assert spans(begin + "at = 0.5", end + "at = 1.0") == [(10, 20, None)]
    assert spans(end + "at = 1.0", begin + "at = 0.5") == [(10, 20, None)]  # wherever they stand


@pytest.mark.parametrize(("begin", "end"), [(PAUSE, RESUME), (DEPART, REJOIN)])
def test_what_would_have_lasted_longer_is_ended_early(begin, end, spans):
    assert spans(begin + "at = 0.5\nlasts = 1.0", end + "at = 1.0") == [(10, 20, None)]


def test_agents_are_ended_one_by_one(spans):
    everybody = KILL.replace("[5]", "[4, 5, 6]") + "at = 0.5"
    assert spans(everybody, RESTART + "at = 1.0") == [(10, None, None), (10, 20, None), (10, None, None)]


def test_only_a_warm_restart_remembers(made):
    killed = KILL.replace("[5]", "[4, 5]") + "at = 0.5"
    warm, cold = RESTART + "at = 1.0\nstate = 'warm'", RESTART.replace("5", "4") + "at = 1.0"
    timeline = made(killed, warm, cold).timeline
    assert (timeline.restarted(20), timeline.remembering(20), timeline.warm) == ([4, 5], [5], {5})


def test_a_heal_ends_everything_on_links_that_is_under_way(made):
    on_links = [
        CUT + "at = 0.1",
        'verb = "partition"\ngroups = "leaders"\nat = 0.2\nlasts = 1.5',
        'verb = "lose"\nlinks = ["2->4"]\nloss = 0.5\nat = 0.3',
        'verb = "delay"\nlinks = ["2->4"]\ndelay = 0.5\nat = 0.4',
        'verb = "degrade"\nlinks = ["2->4"]\nprofile = "wifi_busy"\nat = 0.5',
    ]
    others = [CUT + "at = 0.1\nlasts = 0.2", CUT + "at = 1.5", GUST + "at = 0.1", DEPART + "at = 0.1"]
    faults = made(*on_links, *others, HEAL + "at = 1.0").faults
    assert [fault.end for fault in faults] == [20] * 5 + [6, None, None, None]


def test_a_heal_by_name_ends_what_it_names(spans):
    cuts = [CUT + f"at = 0.1\nname = '{name}'" for name in "abc"]
    assert [end for _, end, _ in spans(*cuts, HEAL + "at = 1.0\nnames = ['a', 'c']")] == [20, None, 20]


def test_heals_end_one_after_the_other(spans):
    cuts = [CUT + f"at = {at}" for at in (0.1, 0.6, 1.1)]
    assert spans(*cuts, HEAL + "at = 1.0", HEAL + "at = 0.5") == [(2, 10, None), (12, 20, None), (22, None, None)]


def test_what_waits_is_ended_in_the_time_that_counts_from_its_condition(spans):
    begin = KILL + WHEN + "name = 'k'"
    assert spans(begin, RESTART + "after = 'k'\nat = 0.5") == [(0, 10, 0)]


NOT_BEGUN = "agent 5 is under no {} then, in the same frame of time, that this could end"
NO_LINKS = "nothing on links is under way then, in the same frame of time, that this could heal"
REFUSED_ENDS = [
    (KILL + "at = 0.5", RESTART + "at = 0.25", NOT_BEGUN.format("kill")),
    (KILL + "at = 0.5", RESTART + "at = 0.5", NOT_BEGUN.format("kill")),
    (KILL.replace("5", "4") + "at = 0.5", RESTART + "at = 1.0", NOT_BEGUN.format("kill")),
    (PAUSE + "at = 0.5", RESTART + "at = 1.0", NOT_BEGUN.format("kill")),
    (KILL + "at = 0.5", RESUME + "at = 1.0", NOT_BEGUN.format("pause")),
    (KILL + "at = 0.5", REJOIN + "at = 1.0", NOT_BEGUN.format("depart")),
    (PAUSE + "at = 0.5\nlasts = 0.25", RESUME + "at = 1.0", NOT_BEGUN.format("pause")),
    (KILL + WHEN, RESTART + "at = 1.0", NOT_BEGUN.format("kill")),
    (KILL + "at = 0.5", RESTART + WHEN + "at = 1.0", NOT_BEGUN.format("kill")),
    (KILL + WHEN, RESTART + WHEN + "at = 1.0", NOT_BEGUN.format("kill")),
    (CUT + "at = 0.5", HEAL + "at = 0.25", NO_LINKS),
    (CUT + "at = 0.5\nlasts = 0.25", HEAL + "at = 0.75", NO_LINKS),
    (CUT + WHEN, HEAL + "at = 0.75", NO_LINKS),
    (KILL + "at = 0.5", HEAL + "at = 1.0", NO_LINKS),
    (GUST + "at = 0.5\nname = 'a'", HEAL + "at = 1.0\nnames = ['a']", NO_LINKS),
    (
        CUT + "at = 0.5\nname = 'a'",
        HEAL + "at = 1.0\nnames = ['a', 'b', 'c']",
        "names: no entry is called 'b', 'c'; there are a",
    ),
]


@pytest.mark.parametrize(("begin", "end", "says"), REFUSED_ENDS)
def test_an_end_without_a_beginning_is_refused(begin, end, says, refused):
    assert refused(begin, end) == (1, "timeline.2", says)


# ---- what is done to whom


@pytest.mark.parametrize(
    ("entry", "fault"),
    [
        (CUT + "at = 1\nin_flight = 'hold'", {"pairs": ((2, 4),), "under_way": UnderWay.HOLD}),
        ("verb = 'partition'\ngroups = 'halves'\nat = 1", {"groups": ((1, 2, 3), (4, 5, 6, 7))}),
        ("verb = 'partition'\ngroups = [[1], [2, 3]]\nat = 1", {"groups": ((1,), (2, 3))}),
        (
            "verb = 'lose'\nlinks = ['2->4', '1->2']\nloss = 0.5\nat = 1",
            {"pairs": ((2, 4), (1, 2)), "probability": 0.5},
        ),
        ("verb = 'delay'\nlinks = ['2->4']\ndelay = 0.5\nat = 1", {"pairs": ((2, 4),), "seconds": 0.5}),
        (
            "verb = 'degrade'\nlinks = ['2->4']\nprofile = 'jammed'\nat = 1",
            {"pairs": ((2, 4),), "profile": 1, "profile_name": "jammed"},
        ),
        (PAUSE + "in_flight = 'drop'\nat = 1", {"agents": (5,), "under_way": UnderWay.DROP}),
        (PAUSE + "at = 1", {"agents": (5,), "under_way": UnderWay.HOLD}),
        ("verb = 'clock'\nagents = [1, 2]\nrate = -0.5\nat = 1", {"agents": (1, 2), "rate": -0.5}),
        (DEPART + "body = 'drift'\nat = 1", {"agents": (5,), "body": "drift"}),
        (GUST + "at = 1", {"agents": (5,), "vector": (1.0, 0.0)}),
        ("verb = 'bias'\nlinks = ['2->4']\nby = [0.0, 1.0]\nat = 1", {"pairs": ((2, 4),), "vector": (0.0, 1.0)}),
        (
            "verb = 'outlier'\nlinks = ['2->4']\np = 0.5\nsigma = 3\nat = 1",
            {"pairs": ((2, 4),), "probability": 0.5, "deviation": 3.0},
        ),
        ("verb = 'dropout'\nlinks = ['2->4']\nat = 1", {"pairs": ((2, 4),), "probability": 1.0}),
        ("verb = 'freeze'\nlinks = ['2->4']\nat = 1", {"pairs": ((2, 4),)}),
        (
            "verb = 'lie'\nagents = [4]\nmatrix = [[0.0, 1.0], [1.0, 0.0]]\nat = 1",
            {"agents": (4,), "matrix": ((0.0, 1.0), (1.0, 0.0))},
        ),
    ],
)
def test_an_entry_becomes_the_fault_it_says(entry, fault, made):
    verb = Verb(entry.split('"')[1] if entry.startswith('verb = "') else entry.split("'")[1])
    assert made(entry).faults == (Fault(verb, 20, None, **fault),)


def test_a_profile_is_numbered_by_whom_it_was_named_first(made):
    names = ["jammed", "wifi_busy", "jammed"]
    built = made(*(f"verb = 'degrade'\nlinks = ['2->4']\nprofile = '{name}'\nat = 1" for name in names))
    assert [fault.profile for fault in built.faults] == [1, 2, 1]
    assert len(built.profiles) == 3


@pytest.mark.parametrize(("verb", "faults"), [(KILL, 2), (PAUSE, 2), (DEPART, 2), (GUST, 1)])
def test_agents_that_can_be_ended_one_by_one_are_faults_of_their_own(verb, faults, made):
    assert len(made(verb.replace("[5]", "[5, 4]") + "at = 1").faults) == faults


REFUSED = [
    ("verb = 'cut'\nlinks = ['2->7', '2-3']\nat = 1", "links", 3, "'2-3' matches no link of the formation"),
    ("verb = 'cut'\nat = 1\nlinks = ['9']", "links", 4, "agent 9 does not exist: agents are 1 to 7"),
    ("verb = 'cut'\nlinks = ['random 25']\nat = 1", "links", 3, "cannot choose 25 of 24 links"),
    ("verb = 'cut'\nlinks = ['1-2', '1~2']\nat = 1", "links.2", 3, "'1~2' selects no links; write '2->4' for what 4"),
    ("verb = 'cut'\nlinks = ['bridges']\nat = 1", "links", 3, "no edge's loss disconnects the formation"),
    ("verb = 'kill'\nat = 1\nagents = [5, 8]", "agents", 4, "agent 8 does not exist: agents are 1 to 7"),
    ("verb = 'kill'\nagents = ['cut-vertices']\nat = 1", "agents", 3, "no agent's loss disconnects the others"),
    ("verb = 'kill'\nagents = ['random 8']\nat = 1", "agents", 3, "cannot choose 8 of 7 agents"),
    ("verb = 'kill'\nagents = []\nat = 1", "agents", 3, "at least 1 item"),
    (
        "verb = 'degrade'\nlinks = ['1-2']\nprofile = 'wifi'\nat = 1",
        "profile",
        4,
        "no profile 'wifi'; did you mean 'wifi_busy'? there are ",
    ),
    ("verb = 'gust'\nagents = [5]\nvelocity = [1.0, 0.0, 0.0]\nat = 1", "velocity", 4, "needs 2 numbers"),
    ("verb = 'gust'\nagents = [5]\nvelocity = [1.0]\nat = 1", "velocity", 4, "at least 2 items"),
    ("verb = 'bias'\nlinks = ['1-2']\nby = [1.0, 0.0, 0.0]\nat = 1", "by", 4, "needs 2 numbers"),
    ("verb = 'lie'\nagents = [5]\nmatrix = [[1,0,0],[0,1,0],[0,0,2]]\nat = 1", "matrix", 4, "must be 2 x 2 numbers"),
    ("verb = 'clock'\nagents = [5]\nrate = -1.0\nat = 1", "rate", 4, "greater than -1"),
    ("verb = 'clock'\nagents = [5]\nrate = 10.0\nat = 1", "rate", 4, "less than 10"),
    ("verb = 'delay'\nlinks = ['1-2']\ndelay = 0.0\nat = 1", "delay", 4, "greater than 0"),
    ("verb = 'outlier'\nlinks = ['1-2']\np = 1.5\nsigma = 1\nat = 1", "p", 4, "less than or equal to 1"),
    ("verb = 'pause'\nagents = [5]\nin_flight = 'deliver'\nat = 1", "in_flight", 4, "should be 'hold' or 'drop'"),
    ("verb = 'depart'\nagents = [5]\nbody = 'fall'\nat = 1", "body", 4, "should be 'hold', 'drift' or 'vanish'"),
    ("verb = 'restart'\nagents = [5]\nstate = 'hot'\nat = 1", "state", 4, "should be 'cold' or 'warm'"),
    ("verb = 'kill'\nagents = [5]\nat = 1\nlasts = 1", "lasts", 5, "unknown key; known here: after, agents, at, every"),
    ("verb = 'heal'\nat = 1\nnames = []", "names", 4, "at least 1 item"),
]


@pytest.mark.parametrize(("entry", "key", "line", "says"), REFUSED, ids=[f"{row[1]}: {row[3]}" for row in REFUSED])
def test_what_is_wrong_in_an_entry_is_named_by_file_line_and_key(entry, key, line, says, refused):
    at, named, why = refused(CUT + "at = 1", entry)
    assert (at, named) == (line, f"timeline.2.{key}")
    assert says in why


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("verb = 'clock'\nagents = [5]\nrate = 0\nat = 1", "rate 0 is a clock that is right"),
        ("verb = 'gust'\nagents = [5]\nvelocity = [0, 0.0]\nat = 1", "velocity is zero: that is nothing"),
        ("verb = 'bias'\nlinks = ['1-2']\nby = [0, 0]\nat = 1", "by is zero: that is nothing"),
        ("verb = 'lie'\nagents = [5]\nmatrix = [[1, 0], [0, 1]]\nat = 1", "matrix is the identity: that is the truth"),
        ("verb = 'lie'\nagents = [5]\nmatrix = [[1, 0], [0]]\nat = 1", "matrix must be 2 x 2, or 3 x 3"),
        ("verb = 'lie'\nagents = [5]\nmatrix = [[2]]\nat = 1", "matrix must be 2 x 2, or 3 x 3"),
        ("verb = 'partition'\ngroups = [[1, 2], [2, 3]]\nat = 1", "agent 2 stands in two groups"),
        ("verb = 'partition'\ngroups = [[1, 2], [9]]\nat = 1", "9"),
        ("verb = 'explode'\nat = 1", "needs a verb among cut, partition, lose, delay, degrade, heal, kill, restart"),
        ("at = 1", "needs a verb among cut, "),
    ],
)
def test_an_entry_that_says_nothing_is_refused_as_a_whole(entry, says, refused):
    line, key, why = refused(CUT + "at = 1", entry)
    assert (line, key) == (1, "timeline.2")
    assert says in why


@pytest.mark.parametrize(
    ("entry", "key", "says"),
    [
        ("verb = 'partition'\ngroups = 'thirds'\nat = 1", "groups", "'halves', 'leaders', 'min-cut'"),
        (
            "verb = 'kill'\nagents = [4, 'leader']\nat = 1",
            "agents.2",
            "'leader' selects no agents; did you mean 'leaders'? write a number",
        ),
    ],
)
def test_a_word_that_is_none_is_one_problem_of_one_key(entry, key, says, refused):
    line, named, why = refused(entry)
    assert (line, named) == (3, f"timeline.1.{key}")
    assert says in why


# ---- timelines that fire


def test_a_trigger_moves_only_what_waits_for_it(made):
    built = made(GUST + WHEN + "lasts = 0.1", KILL + WHEN + "at = 0.2", CUT + "at = 0.5")
    fired = built.timeline.fired([1], 8)
    assert isinstance(fired, Timeline)
    assert [(fault.start, fault.end, fault.trigger) for fault in fired.faults] == [
        (0, 2, 0),
        (12, None, None),
        (10, None, None),
    ]
    assert fired.pending == (0,)
