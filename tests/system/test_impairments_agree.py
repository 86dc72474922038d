"""Every impairment, alone and together, gives the same bits over processes as in one process; and again from its journal."""

import json
import random
from dataclasses import replace

import numpy as np
import pytest
from flying import PROCESSES

from affinet.planning import making as planning
from affinet.runtimes.run import fly
from affinet.scenario import loading
from netem.medium import journal
from netem.medium.medium import JOURNAL
from world.books import history

pytestmark = PROCESSES

LOSSES = {
    "bernoulli": {"p": 0.2},
    "gilbert": {"loss": 0.2, "burst": 4.0, "extra_delay": 0.06},
    "gilbert-elliott": {"p": 0.05, "r": 0.3, "bad": 0.9, "good": 0.02, "step": "packet", "extra_delay": 0.05},
    "markov": {"p13": 0.05, "p31": 0.3, "p32": 0.2, "p23": 0.4, "p14": 0.02},
    "bursts": {"loss": 0.2, "lengths": [0.5, 0.2, 0.3]},
    "list": {"messages": [0, 3, 4, 11]},
    "disk": {"range": 4.0},
    "ramp": {"inner": 1.0, "outer": 6.0},
    "log-distance": {"range": 6.0, "exponent": 2.5, "shadowing": 5.0, "coherence": 0.2},
    "round-robin": {"hold": 2},
    "slotted": {"hold": 1},
    "duty-cycle": {"period": 5, "on": 4},
}
DELAYS = {
    "constant": {"mean": 0.1},
    "uniform": {"mean": 0.05, "jitter": 0.1},
    "normal": {"mean": 0.1, "jitter": 0.05, "correlation": 0.7},
    "exponential": {"mean": 0.08, "order": "kept"},
    "pareto": {"mean": 0.06, "jitter": 0.1},
    "table": {"table": [0.0, 0.01, 0.1, 0.3]},
}
CORRUPTIONS = [
    {"kind": "stale", "p": 0.2},
    {"kind": "bias", "p": 0.1, "by": 1e-3},
    {"kind": "bit-flip", "p": 0.0},
    {"kind": "nan", "p": 0.0},
]
TIMELINE = [
    {"verb": "cut", "at": 0.3, "until": 0.8, "links": ["1-2", "4->6"], "in_flight": "hold"},
    {"verb": "partition", "at": 0.9, "until": 1.1, "groups": [[1, 2, 3], [4, 5]], "in_flight": "drop"},
    {"verb": "lose", "at": 0.2, "until": 1.4, "links": ["leaders->followers"], "loss": 0.3},
    {"verb": "cut", "at": 1.2, "until": 1.4, "links": ["3-6"], "in_flight": "deliver"},
    {"verb": "kill", "at": 0.6, "agents": [7]},
    {"verb": "restart", "at": 1.0, "agents": [7]},
]
APART = ({"disk", "ramp", "log-distance"}, {"round-robin", "slotted", "duty-cycle"})
FAST, ALL = range(6), range(40)


def combination(number):
    """The network and timeline of one combination: every impairment is in one of every few."""
    draw = random.Random(number)
    models = list(LOSSES)
    due = [models[number % 12], models[(number + 6) % 12]]
    chosen = {*due, *draw.sample(models, 3)}
    for rivals in APART:
        chosen -= set(sorted(chosen & rivals, key=lambda name: (name not in due, name))[1:])
    law = list(DELAYS)[number % len(DELAYS)]
    profile = {
        "loss": [{"model": name} | LOSSES[name] for name in sorted(chosen)],
        "delay": {"model": law} | DELAYS[law],
        "duplicate": draw.choice([0.0, 0.2]),
        "reorder": draw.choice([0.0, 0.3]),
        "corrupt": CORRUPTIONS[: 1 + number % 2],
    }
    if number % 3 == 0:
        profile["rate"] = {"rate": 60_000.0, "queue": 2_000, "burst": 500}
    coupled = number % 2 == 0
    links = [{"links": "4->all", "profile": "wifi_busy"}, {"links": "6-7", "availability": 0.5, "delay_ticks": 2}]
    if not coupled:
        links.append({"links": "leaders", "profile": "jammed", "channels": "sensing"})
    zones = [{"centre": [0.0, 0.0], "radius": 2.0, "share": 0.4}] if number % 2 else []
    network = {
        "coupled": coupled,
        "profile": "mixed",
        "profiles": {"mixed": profile},
        "links": links,
        "zones": zones,
    }
    return network, draw.sample(TIMELINE[:4], 2) + TIMELINE[4:] * (number % 2)


def written(folder, number):
    network, timeline = combination(number)
    base = json.loads(planning.make(loading.load("corridor")).scenario.model_dump_json(exclude_none=True))
    base |= {"network": network, "timeline": timeline, "seed": number + 1}
    base["time"] = {"dt": 0.05, "duration": 2.0}
    base["agents"]["law"] = "static"
    base["agents"]["parameters"] = {}
    folder.mkdir(parents=True)
    (folder / loading.FILE).write_text(json.dumps(base))
    return planning.make(loading.resolved(folder))


def flown(plan, runtime, out):
    outcome = fly(plan, runtime, out, lambda *_: None)
    assert not [reason for reason in outcome.reasons if "proved nothing" not in reason], outcome.reasons
    return outcome


def check(number, tmp_path):
    plan = written(tmp_path / "told", number)
    one, many = (flown(plan, runtime, tmp_path / runtime) for runtime in ("inprocess", "processes"))
    assert one.digest == many.digest
    books = [journal.read(tmp_path / runtime / JOURNAL) for runtime in ("inprocess", "processes")]
    assert books[0].equals(books[1])
    reseeded = replace(plan, scenario=plan.scenario.model_copy(update={"seed": 99}))
    again = replace(reseeded, journal=tmp_path / "processes" / JOURNAL)
    flown(again, "inprocess", tmp_path / "again")
    arrays, repeated = (history.load(tmp_path / run / history.ARRAYS) for run in ("processes", "again"))
    for name in ("verdicts", "newest", "copies", "late", "dropped"):
        assert np.array_equal(arrays[name], repeated[name]), name
    assert journal.read(tmp_path / "again" / JOURNAL).equals(books[0])


def test_the_fast_combinations_hold_every_impairment():
    profiles = [combination(number)[0]["profiles"]["mixed"] for number in FAST]
    assert {loss["model"] for profile in profiles for loss in profile["loss"]} == set(LOSSES)
    assert {profile["delay"]["model"] for profile in profiles} == set(DELAYS)


@pytest.mark.parametrize("number", FAST)
def test_combinations_agree_between_runtimes_and_with_their_journal(number, tmp_path):
    check(number, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", [number for number in ALL if number not in FAST])
def test_more_combinations_agree(number, tmp_path):
    check(number, tmp_path)


@pytest.mark.parametrize("kind", ["nan", "bit-flip"])
def test_poisoned_messages_arrive_alike(kind, tmp_path):
    corrupt = f'network.profiles.bad={{corrupt=[{{kind="{kind}",p=0.02}}]}}'
    overrides = ("time.duration=1", "time.dt=0.05", corrupt, 'network.profile="bad"', 'agents.law="static"')
    plan = planning.make(loading.load("corridor", overrides))
    one, many = (fly(plan, runtime, tmp_path / runtime, lambda *_: None) for runtime in ("inprocess", "processes"))
    assert one.digest == many.digest
    marks = journal.read(tmp_path / "processes" / JOURNAL)["mark"].drop_null().to_pylist()
    assert set(marks) == {kind}
