"""What checkers find: that it holds, the first tick in which it does not, or that the run never put it to the test."""

import re
from collections import Counter
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from judged import changed, evidence, tampered
from scripted import timeline

from affinet.verdicts import checkers
from affinet.verdicts.checking import Checker, CheckResult
from analysis.metrics import consistency

TICKS = 80
CUT = {"verb": "cut", "at": 1.0, "until": 2.0, "links": ["2->4"]}  # ticks 20 to 39
NO_DELAY = ("network.availability=1.0",)


def verdict(found):
    of_its_own = found.verdict == "fail" and "because of" not in found.says
    assert not of_its_own or f" s (tick {found.tick})" in found.says  # where one looks first in a recording
    return found.verdict, found.tick


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (lambda: checkers.bounded(np.nan), "bounded(nan): level is nan: give a finite number above 0"),
        (lambda: checkers.bounded(np.inf), "bounded(inf): level is inf: give a finite number above 0"),
        (lambda: checkers.energy(np.inf), "energy(inf): level is inf: give a finite number above 0"),
        (lambda: checkers.collision_free(-1), "collision_free(-1): distance is -1: give a finite number above 0"),
        (lambda: checkers.converged(1.0, by=-5), "converged(1, by=-5): by is -5: give finite seconds, at least 0"),
        (lambda: checkers.recovers(1.0, within=-1), "recovers(1, within=-1): within is -1: give finite seconds"),
        (lambda: checkers.smooth(2), "smooth(2): share is one of the steps, at least 0 and below 1"),
        (lambda: checkers.smooth(np.nan), "smooth(nan): share is one of the steps, at least 0 and below 1"),
    ],
)
def test_a_checker_that_could_say_nothing_is_not_made(made, says):
    with pytest.raises(ValueError, match=f"^{re.escape(says)}"):
        made()


def with_error(run, error):
    return tampered(run, error=np.broadcast_to(np.asarray(error, dtype=np.float64), (TICKS,)))


def test_bounded_passes_for_a_run_that_stays_below_the_level():
    run = evidence()
    assert verdict(checkers.bounded(run.error.max() + 1e-9)(run)) == ("pass", None)


def test_bounded_fails_at_the_first_tick_that_reaches_the_level():
    run = evidence()
    assert verdict(checkers.bounded(run.error.max())(run)) == ("fail", int(run.error.argmax()))
    assert verdict(checkers.bounded(5.0)(with_error(run, changed(run.error, [17, 40], 5.0)))) == ("fail", 17)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
@pytest.mark.parametrize("checker", [checkers.bounded(5.0), checkers.converged(5.0, by=0.5)], ids=lambda c: c.name)
def test_an_error_that_is_no_number_is_never_good(checker, wrong):
    run = evidence()
    assert verdict(checker(with_error(run, changed(run.error, 17, wrong)))) == ("fail", 17)


def test_converged_passes_once_the_swarm_has_settled():
    run = evidence()
    level = run.error[40:].max() + 1e-9
    assert run.error.max() > level
    assert verdict(checkers.converged(level, by=2.0)(run)) == ("pass", None)


def test_converged_fails_at_the_first_tick_from_then_on():
    run = with_error(evidence(), changed(evidence().error, [17, 40], 5.0))
    assert verdict(checkers.converged(5.0, by=0.85)(run)) == ("fail", 17)
    assert verdict(checkers.converged(5.0, by=0.9)(run)) == ("fail", 40)


def test_converged_is_vacuous_when_the_run_ends_before():
    assert verdict(checkers.converged(5.0, by=4.0)(evidence())) == ("vacuous", None)


GUST = {"verb": "gust", "at": 1.0, "lasts": 0.5, "agents": [7], "velocity": [3.0, 0.0]}


def test_recovers_passes_after_a_gust_that_the_law_makes_good():
    run = evidence(timeline(GUST), "formation.spread=0.0", "time.duration=4")
    assert run.error[20:30].max() > 0.3
    found = checkers.recovers(0.3, within=2.0)(run)
    assert verdict(found) == ("pass", None)
    assert found.says == "after 1 faults"


def test_recovers_fails_at_the_deadline_after_a_gust_that_takes_longer():
    run = evidence(timeline(GUST), "formation.spread=0.0", "time.duration=8")
    found = checkers.recovers(0.1, within=0.1)(run)
    assert verdict(found) == ("fail", 30 + 2)
    assert "gust (3, 0) m/s on 7" in found.says


def under(*entries):
    return evidence(timeline(*entries), *NO_DELAY)


def lifted(until, level=5.0):
    """An error at a level from tick 25 until a tick, and small else."""
    tick = np.arange(TICKS)
    return np.where((tick >= 25) & (tick < until), level, 0.01)


@pytest.mark.parametrize(
    ("until", "expected"),
    [(30, ("pass", None)), (60, ("pass", None)), (61, ("fail", 60)), (80, ("fail", 60))],
)
def test_recovers_counts_from_the_end_of_the_fault(until, expected):
    assert verdict(checkers.recovers(1.0, within=1.0)(with_error(under(CUT), lifted(until)))) == expected


def test_recovers_takes_an_error_that_is_no_number_for_none_that_fell():
    run = with_error(under(CUT), lifted(TICKS, np.nan))
    assert verdict(checkers.recovers(1.0, within=1.0)(run)) == ("fail", 60)


CONDITION = {"tracking_error_above": 1e6}


@pytest.mark.parametrize(
    "entries",
    [
        (),
        ({"verb": "cut", "at": 1.0, "links": ["2->4"]},),
        (CUT | {"until": 3.1},),
        (CUT, CUT | {"at": 2.5, "until": 3.5}),
        ({"verb": "cut", "when": CONDITION, "lasts": 1.0, "links": ["2->4"]},),
    ],
    ids=["no fault", "for ever", "too late", "the next comes before", "never came"],
)
def test_recovers_is_vacuous_when_no_fault_ends_in_time_to_tell(entries):
    found = checkers.recovers(1.0, within=1.0)(with_error(under(*entries), 5.0))
    assert verdict(found) == ("vacuous", None)


def test_recovers_is_vacuous_when_no_fault_lifted_the_error():
    assert verdict(checkers.recovers(1.0, within=1.0)(with_error(under(CUT), 0.5))) == ("vacuous", None)


def test_recovers_does_not_look_at_a_fault_whose_end_is_the_beginning_of_the_next():
    entries = CUT | {"until": 1.5}, CUT | {"at": 1.5, "until": 3.5}
    found = checkers.recovers(1.0, within=1.0)(with_error(under(*entries), lifted(75)))
    assert verdict(found) == ("vacuous", None)
    short = "'cut 2->4' had {} s until another began or the run ended, and needs more than 1"
    assert found.says.partition("; ")[2] == "; ".join([short.format(0), short.format(0.5)])


def test_recovers_fails_after_the_first_fault_that_is_not_made_good():
    entries = CUT | {"at": 0.5, "until": 1.0}, CUT | {"at": 2.0, "until": 2.5}
    error = np.where(np.arange(TICKS) < 25, 0.01, 5.0)
    error[15] = 5.0
    assert verdict(checkers.recovers(1.0, within=0.5)(with_error(under(*entries), error))) == ("fail", 30)


def above(*spans):
    """An error that is 5 m2 in these spans of ticks, and small else."""
    tick = np.arange(TICKS)
    return np.where(np.any([(tick >= start) & (tick < end) for start, end in spans], axis=0), 5.0, 0.01)


@pytest.mark.parametrize(
    ("spans", "expected"),
    [
        ([(0, 45)], "vacuous"),
        ([(15, 45)], "vacuous"),
        ([(15, TICKS)], "vacuous"),
        ([(15, 25), (30, 45)], "pass"),
        ([(20, 45)], "pass"),
    ],
    ids=["since take-off", "lifted before", "lifted before, for good", "lifted again", "lifted in its first tick"],
)
def test_recovers_looks_at_no_fault_before_which_the_error_was_above_already(spans, expected):
    found = checkers.recovers(1.0, within=1.0)(with_error(under(CUT), above(*spans)))
    assert verdict(found) == (expected, None)
    if expected == "vacuous":
        assert found.says.endswith("it was above before 'cut 2->4' began, at 1 s")


@pytest.mark.parametrize(
    ("spans", "expected"),
    [
        ([(16, 55)], ("pass", None)),
        ([(16, TICKS)], ("fail", 60)),
        ([(8, 55)], ("vacuous", None)),
    ],
    ids=["made good", "not made good", "lifted before both"],
)
def test_recovers_looks_at_a_fault_that_begins_under_what_an_earlier_one_lifted(spans, expected):
    earlier = CUT | {"at": 0.5, "until": 0.75}  # ticks 10 to 14; what it lifts has until 34
    assert verdict(checkers.recovers(1.0, within=1.0)(with_error(under(earlier, CUT), above(*spans)))) == expected


def test_recovers_counts_no_fault_that_touched_nothing():
    deaf = {"verb": "lie", "at": 1.0, "until": 2.0, "agents": [4], "matrix": [[2.0, 0.0], [0.0, 2.0]]}
    run = with_error(evidence(timeline(deaf), "agents.estimator=rkf", *NO_DELAY), above((25, 45)))
    assert [bite.touched for bite in run.bites] == [0]
    assert verdict(checkers.recovers(1.0, within=1.0)(run)) == ("vacuous", None)


PARTITION = {"verb": "partition", "at": 1.0, "until": 2.0, "groups": [[1, 2, 3], [4, 5, 6, 7]]}


@pytest.mark.parametrize("in_flight", ["drop", "deliver", "hold"])
@pytest.mark.parametrize("fault", [CUT, PARTITION], ids=lambda fault: fault["verb"])
def test_nothing_said_under_a_cut_is_heard_across_it(fault, in_flight):
    run = evidence(timeline(fault | {"in_flight": in_flight}), "network.delay_ticks=3")
    assert verdict(checkers.never_heard_across_a_cut()(run)) == ("pass", None)


def heard(run, tick, channel, src, dst, spoken):
    place = (tick, run.plan.channels.index(channel), run.plan.world.links.index[src, dst])
    return tampered(run, newest=changed(run.arrays["newest"], place, spoken))


def test_what_is_heard_across_a_cut_is_named_with_its_tick_link_and_channel():
    run = under(CUT)
    channel = run.plan.channels[-1]
    found = checkers.never_heard_across_a_cut()(heard(run, 27, channel, 2, 4, 25))
    assert verdict(found) == ("fail", 27)
    assert found.says == f"at 1.35 s (tick 27) 4 heard 2 on {channel} across 'cut 2->4'"


def test_what_is_heard_across_a_partition_is_named_with_its_link():
    found = checkers.never_heard_across_a_cut()(heard(under(PARTITION), 20, "sense", 7, 2, 20))
    assert verdict(found) == ("fail", 20)
    assert found.says == "at 1 s (tick 20) 2 heard 7 on sense across 'partition 1,2,3 | 4,5,6,7'"


@pytest.mark.parametrize(
    ("tick", "link", "spoken"),
    [(27, (2, 4), 19), (40, (2, 4), 39), (19, (2, 4), 19), (27, (4, 2), 27)],
    ids=["said before", "heard after", "heard before", "the other way"],
)
def test_what_a_cut_does_not_forbid_may_be_heard(tick, link, spoken):
    run = heard(under(CUT), tick, "sense", *link, spoken)
    assert verdict(checkers.never_heard_across_a_cut()(run)) == ("pass", None)


@pytest.mark.parametrize(
    "entries",
    [
        (),
        ({"verb": "lose", "at": 1.0, "links": ["all"], "loss": 1.0},),
        (CUT | {"at": 5.0, "until": 6.0},),
        ({"verb": "cut", "when": CONDITION, "links": ["2->4"]},),
        ({"verb": "depart", "at": 0.5, "agents": [2], "body": "vanish"}, CUT),
    ],
    ids=["nothing", "no cut", "after the end", "never came", "nobody spoke"],
)
def test_never_heard_is_vacuous_when_nothing_was_cut(entries):
    assert verdict(checkers.never_heard_across_a_cut()(under(*entries))) == ("vacuous", None)


HONEST = ('agents.estimator="none"', 'manoeuvre={preset="hover"}', *NO_DELAY)


def mean_nees_by_hand(run):
    """Edge by edge, matrix by matrix: the mean of each tick, and the number of edges."""
    links, arrays, means, numbers = run.plan.world.links, run.arrays, [], []
    for tick in range(run.ticks):
        each = []
        for agent, slot in zip(*np.nonzero(arrays["known"][tick]), strict=True):
            other = links.neighbours[agent, slot]
            error = arrays["estimate"][tick, agent, slot] - (run.position[tick, agent] - run.position[tick, other])
            xx, xy, yy = arrays["covariance"][tick, agent, slot]
            each.append(error @ np.linalg.inv([[xx, xy], [xy, yy]]) @ error)
        means.append(np.mean(each))
        numbers.append(len(each))
    return np.array(means), np.array(numbers)


def test_what_a_sensor_says_of_its_own_noise_is_consistent():
    run = evidence(*HONEST)
    found = checkers.consistent()(run)
    assert verdict(found) == ("pass", None)
    assert found.says.startswith(f"mean NEES {mean_nees_by_hand(run)[0].mean():.3g} +- ")


@pytest.mark.parametrize("scale", [0.1, 0.7, 1.4, 10.0])
def test_a_covariance_that_says_too_little_or_too_much_is_not_consistent(scale):
    run = evidence(*HONEST)
    assert checkers.consistent()(tampered(run, covariance=scale * run.arrays["covariance"])).verdict == "fail"


def test_consistent_names_where_it_begins_to_be_wrong():
    run = evidence(*HONEST)
    late = tampered(
        run, covariance=np.where(np.arange(TICKS)[:, None, None, None] < 33, 1.0, 0.1) * run.arrays["covariance"]
    )
    assert verdict(checkers.consistent()(late)) == ("fail", 32)  # of ten batches the fifth begins there
    assert checkers.consistent(since=2.0)(late).tick >= 40


@pytest.mark.parametrize("level", [0.9, 0.99])
def test_an_honest_sensor_is_consistent_whatever_the_seed(level):
    verdicts = [checkers.consistent(level)(evidence(*HONEST, f"seed={seed}")).verdict for seed in range(1, 13)]
    assert verdicts.count("pass") >= 12 * level - 2


def test_a_filter_that_is_wrong_in_one_tick_of_four_is_not_consistent():
    run = evidence(*HONEST)
    wrong = np.arange(TICKS) % 4 == 3
    scaled = np.where(wrong[:, None, None, None], 0.1, 1.0) * run.arrays["covariance"]
    assert checkers.consistent()(tampered(run, covariance=scaled)).verdict == "fail"


def test_an_estimate_that_is_no_number_is_not_consistent():
    run = evidence(*HONEST)
    found = checkers.consistent()(tampered(run, estimate=changed(run.arrays["estimate"], 17, np.nan)))
    assert verdict(found) == ("fail", 17)


# Filters planted: errors correlated from tick to tick, of edges that share half of what drives them, or nothing.


def planted(runs, ticks, memory, shared, wrong):
    """Mean NEES, shape (runs, T), of 24 edges whose covariances are too small by the factor `wrong`."""
    rng = np.random.default_rng(5)
    x, series = rng.normal(size=(runs, 24, 2)), np.empty((runs, ticks))
    for tick in range(ticks):
        drive = np.sqrt(shared) * rng.normal(size=(runs, 1, 2)) + np.sqrt(1 - shared) * rng.normal(size=(runs, 24, 2))
        x = memory * x + np.sqrt(1 - memory**2) * drive
        series[:, tick] = wrong * (x * x).sum(axis=-1).mean(axis=-1)
    return series


def judged(monkeypatch, all_runs):
    ticks = all_runs.shape[1]
    run = SimpleNamespace(ticks=ticks, dt=1.0, tick=int, plan=evidence(*HONEST).plan)
    found = Counter()
    for series in all_runs:
        told = consistency.Normalised(series, np.full(ticks, 24))
        monkeypatch.setattr(checkers, "_mean_nees", lambda *_, told=told: told)
        found[checkers.consistent()(run).verdict] += 1
    return found


PLANTED = [
    # ticks, memory, shared, wrong: at most so many false fails of 200, or at least so many fails
    (1000, 0.9, 0.0, 1.0, "at most", 8),
    (1000, 0.9, 0.5, 1.0, "at most", 8),
    (4000, 0.97, 0.5, 1.0, "at most", 8),
    (20, 0.95, 1.0, 1.0, "at most", 8),
    (60, 0.95, 1.0, 1.0, "at most", 8),
    (200, 0.99, 0.0, 1.0, "at most", 8),
    (200, 0.99, 1.0, 1.0, "at most", 8),
    (1000, 0.99, 0.5, 1.0, "at most", 8),
    (1000, 0.9, 0.0, 1.05, "at least", 30),
    (1000, 0.9, 0.0, 1.1, "at least", 160),
    (1000, 0.9, 0.0, 0.9, "at least", 160),
    (1000, 0.9, 0.5, 1.25, "at least", 140),
    (1000, 0.9, 0.5, 2.0, "at least", 198),
]


@pytest.mark.parametrize(("ticks", "memory", "shared", "wrong", "bound", "number"), PLANTED)
def test_consistent_passes_filters_that_tell_the_truth_and_fails_the_others(
    ticks, memory, shared, wrong, bound, number, monkeypatch
):
    found = judged(monkeypatch, planted(200, ticks, memory, shared, wrong))
    assert found["fail"] <= number if bound == "at most" else found["fail"] >= number
    if wrong == 1.0:  # enough ticks tell, too few do not
        assert found["pass"] >= 180 or found["vacuous"] >= 180 or ticks * (1 - memory) < 20


def test_a_run_too_short_to_tell_is_vacuous_and_one_that_diverges_is_not(monkeypatch):
    short = judged(monkeypatch, planted(200, 100, 0.97, 0.5, 1.0))
    assert short["vacuous"] >= 190
    growing = planted(50, 1000, 0.9, 0.0, 1.0) * np.exp(np.linspace(-5.0, 5.0, 1000))
    assert judged(monkeypatch, growing)["fail"] == 50
    monkeypatch.undo()
    run = evidence(*HONEST)
    assert verdict(checkers.consistent(since=(TICKS - 10) * run.dt)(run)) == ("vacuous", None)


def test_consistent_looks_at_agents_that_take_part_only():
    run = evidence(*HONEST, timeline({"verb": "depart", "at": 0.0, "agents": [7]}))
    wild = tampered(run, estimate=changed(run.arrays["estimate"], (slice(None), 6), 1e3))
    known = changed(run.arrays["known"], (slice(None), 6), True)
    assert checkers.consistent()(tampered(wild, known=known)) == checkers.consistent()(run)


@pytest.mark.parametrize("verb", ["cut", "dropout"])
def test_consistent_is_vacuous_when_nobody_estimates_anything(verb):
    blind = evidence(*HONEST, timeline({"verb": verb, "at": 0.0, "links": ["all"]}))
    assert verdict(checkers.consistent()(blind)) == ("vacuous", None)


def test_consistent_is_vacuous_when_the_run_ends_before():
    assert verdict(checkers.consistent(since=4.0)(evidence(*HONEST))) == ("vacuous", None)


def closest(run):
    """The least distance of any two agents in each tick."""
    apart = np.linalg.norm(run.position[:, :, None] - run.position[:, None], axis=-1)
    return np.where(np.eye(7, dtype=bool), np.inf, apart).min(axis=(1, 2))


def test_collision_free_passes_up_to_the_least_distance_flown():
    run = evidence()
    assert verdict(checkers.collision_free(closest(run).min())(run)) == ("pass", None)


def test_collision_free_fails_at_the_first_tick_too_close():
    run = evidence()
    level = np.nextafter(closest(run).min(), np.inf)
    assert verdict(checkers.collision_free(level)(run)) == ("fail", int(closest(run).argmin()))


def side_by_side(run, tick, one, other):
    beside = run.arrays["position"][tick, other - 1] + [0.01, 0.0]
    return tampered(run, position=changed(run.arrays["position"], (tick, one - 1), beside))


def test_a_collision_is_named_with_its_tick_and_agents():
    run = evidence("formation.spread=0.0")
    found = checkers.collision_free(0.2)(side_by_side(run, 17, 3, 6))
    assert verdict(found) == ("fail", 17)
    assert "agents 3 and 6 are 0.01 m apart" in found.says


def test_a_position_that_is_no_number_is_not_free_of_collisions():
    run = evidence("formation.spread=0.0")
    broken = tampered(run, position=changed(run.arrays["position"], (17, 3), np.nan))
    assert verdict(checkers.collision_free(0.2)(broken)) == ("fail", 17)


@pytest.mark.parametrize("checker", [checkers.energy(1.0), checkers.collision_free(0.2)], ids=lambda c: c.name)
def test_a_run_that_diverged_is_judged_without_warnings(checker):
    run = evidence()
    far = changed(run.arrays["position"], slice(40, None), 1e200 * np.arange(14.0).reshape(7, 2))
    fast = changed(run.arrays["input"], slice(40, None), 1e200)
    checker(tampered(run, position=far, input=fast))


@pytest.mark.parametrize(("body", "expected"), [("hold", ("fail", 30)), ("vanish", ("pass", None))])
def test_nobody_collides_with_a_body_that_is_gone(body, expected):
    run = evidence("formation.spread=0.0", timeline({"verb": "depart", "at": 1.0, "agents": [6], "body": body}))
    assert verdict(checkers.collision_free(0.2)(side_by_side(run, 30, 3, 6))) == expected


def test_collision_free_is_vacuous_where_there_are_never_two_bodies():
    gone = {"verb": "depart", "at": 0.0, "agents": [2, 3, 4, 5, 6, 7], "body": "vanish"}
    assert verdict(checkers.collision_free(0.2)(evidence(timeline(gone)))) == ("vacuous", None)


EDGE_METRICS = ["estimation_error", "covariance_trace", "nees"]


@pytest.mark.parametrize("metric", EDGE_METRICS)
def test_below_is_vacuous_where_no_edge_is_estimated(metric):
    run = evidence(*HONEST)
    nobody = tampered(run, known=np.zeros_like(run.arrays["known"]))
    assert verdict(checkers.below(metric, 1e6)(run)) == ("pass", None)
    assert verdict(checkers.below(metric, 1e6)(nobody)) == ("vacuous", None)
    some = run.arrays["known"] & (np.arange(TICKS) >= 40)[:, None, None]
    assert verdict(checkers.below(metric, 1e6)(tampered(run, known=some))) == ("pass", None)


@pytest.mark.parametrize("metric", EDGE_METRICS)
def test_what_is_no_number_any_more_is_not_below(metric):
    run = evidence(*HONEST)
    lost = {name: changed(run.arrays[name], 17, np.nan) for name in ("estimate", "covariance")}
    assert verdict(checkers.below(metric, 1e6)(tampered(run, **lost))) == ("fail", 17)
    astray = tampered(run, position=changed(run.arrays["position"], 17, np.nan))
    assert verdict(checkers.below("procrustes", 1e6)(astray)) == ("fail", 17)


def test_below_is_vacuous_when_the_run_ends_before():
    found = checkers.below("procrustes", 1.0, since=10.0)(evidence(*HONEST))
    assert (found.verdict, found.says) == ("vacuous", "the run ended before")


def test_agreement_passes_where_neighbours_perceive_the_same_map():
    run = evidence()
    level = np.nanmax(run.arrays["psi"][40:]) + 1e-9
    assert verdict(checkers.agreement(level, by=2.0)(run)) == ("pass", None)


def test_agreement_fails_at_the_first_tick_and_names_the_agent():
    psi = changed(np.zeros((TICKS, 7)), ([17, 40], [4, 2]), 9.0)
    found = checkers.agreement(1.0)(tampered(evidence(), psi=psi))
    assert verdict(found) == ("fail", 17)
    assert "psi of agent 5 is 9" in found.says
    assert verdict(checkers.agreement(1.0, by=0.9)(tampered(evidence(), psi=psi))) == ("fail", 40)


def test_agreement_leaves_out_who_heard_nobody():
    psi = changed(np.zeros((TICKS, 7)), (17, 4), np.nan)
    assert verdict(checkers.agreement(1.0)(tampered(evidence(), psi=psi))) == ("pass", None)


def test_agreement_is_vacuous_where_nobody_perceives_a_map():
    assert verdict(checkers.agreement(1.0)(evidence('agents.estimator="rkf"'))) == ("vacuous", None)


def test_agreement_is_vacuous_when_the_run_ends_before():
    assert verdict(checkers.agreement(1.0, by=4.0)(evidence())) == ("vacuous", None)


def spent(run):
    return np.cumsum((run.arrays["input"] ** 2).sum(axis=(1, 2)) * 0.05)


def test_energy_passes_above_what_was_spent_and_fails_in_the_tick_that_spends_it():
    run = evidence()
    total = spent(run)
    assert verdict(checkers.energy(total[-1] * (1 + 1e-12))(run)) == ("pass", None)
    assert verdict(checkers.energy(total[17] * (1 - 1e-12))(run)) == ("fail", 17)


def test_energy_of_agents_that_are_absent_is_not_counted():
    run = evidence(timeline({"verb": "depart", "at": 1.0, "until": 2.0, "agents": [7], "body": "drift"}))
    velocity = np.zeros((TICKS, 7, 2))
    velocity[20:, 6, 0] = 2.0
    assert verdict(checkers.energy(0.1)(tampered(run, input=velocity))) == ("fail", 40)


def test_an_input_that_is_no_number_spends_too_much():
    run = evidence()
    broken = tampered(run, input=changed(run.arrays["input"], (17, 3), np.nan))
    assert verdict(checkers.energy(1e9)(broken)) == ("fail", 17)


def says(verdict, tick=None):
    name = verdict if tick is None else f"{verdict}@{tick}"
    return Checker(name, lambda _: CheckResult(name, verdict, tick, f"because of {name}"))


VERDICTS = ("pass", "fail", "vacuous")
PAIRS = list(product(VERDICTS, repeat=2))
BY_TICK = {"pass": None, "fail": 17, "vacuous": None}


@pytest.mark.parametrize(("one", "other"), PAIRS)
def test_both_hold_unless_one_fails_and_prove_nothing_if_one_proves_nothing(one, other):
    found = (says(one, BY_TICK[one]) & says(other, BY_TICK[other]))(evidence())
    expected = next(each for each in ("fail", "vacuous", "pass") if each in (one, other))
    assert verdict(found) == (expected, BY_TICK[expected])


@pytest.mark.parametrize(("one", "other"), PAIRS)
def test_either_holds_if_one_does_and_fails_if_both_do(one, other):
    found = (says(one, BY_TICK[one]) | says(other, BY_TICK[other]))(evidence())
    expected = next(each for each in ("pass", "vacuous", "fail") if each in (one, other))
    assert verdict(found) == (expected, BY_TICK[expected])


def test_of_two_failures_the_first_counts():
    found = (says("fail", 30) & says("fail", 17))(evidence())
    assert verdict(found) == ("fail", 17)
    assert found.says == "fail@17: because of fail@17"
    assert found.checker == "(fail@30 & fail@17)"


def test_what_must_not_hold_fails_at_the_end_when_it_held():
    assert verdict((~says("pass"))(evidence())) == ("fail", TICKS - 1)
    assert verdict((~says("fail", 17))(evidence())) == ("pass", None)
    assert verdict((~says("vacuous"))(evidence())) == ("vacuous", None)
    assert (~says("pass")).name == "~pass"


@pytest.mark.parametrize(("one", "other"), PAIRS)
def test_de_morgan_holds(one, other):
    a, b = says(one, BY_TICK[one]), says(other, BY_TICK[other])
    assert (~(a & b))(evidence()).verdict == (~a | ~b)(evidence()).verdict
    assert (~(a | b))(evidence()).verdict == (~a & ~b)(evidence()).verdict


@pytest.mark.parametrize(("run", "found"), PAIRS)
def test_a_failure_outweighs_what_proved_nothing_and_that_outweighs_a_pass(run, found):
    judged = replace(evidence(), outcome=replace(evidence().outcome, verdict=run))
    findings = [CheckResult("first", "pass", None, ""), CheckResult("second", found, BY_TICK[found], "")]
    expected = next(each for each in ("fail", "vacuous", "pass") if each in (run, found))
    assert checkers.summed_up(judged, findings) == expected
    assert checkers.summed_up(judged, []) == run


def test_a_finding_says_its_checker_verdict_and_reason():
    found = checkers.bounded(1e-9)(evidence())
    assert (
        str(found)
        == f"bounded(1e-09): fail: at 0 s (tick 0) it does not hold; the error is {evidence().error[0]:.4g} m²"
    )
