"""Signals and what follows them through a run: held against their definitions, tick by tick, unknowns among them."""

import re
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from judged import evidence, tampered

from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import invariants
from affinet.verdicts.flown import FlownRun
from affinet.verdicts.quantities import QUANTITIES, Quantity, quantity
from affinet.verdicts.signals import Signal, Truths
from affinet.verdicts.temporal import always, eventually, until
from netem.processes.user_code import UserCodeError

DT, TICKS = 0.1, 7
YES, NO, UNKNOWN = True, False, None


def run(ticks=TICKS):
    return SimpleNamespace(
        ticks=ticks, dt=DT, tick=lambda seconds: round(seconds / DT), located=np.ones(ticks, dtype=bool)
    )


def planted(*values):
    """A signal that is so: it holds, does not, or is unknown."""
    holds, fails = (np.array([value is kind for value in values]) for kind in (YES, NO))
    return Signal("planted", lambda _: Truths.known(holds, fails), lambda _, tick: f"tick {tick} is so")


def read(signal):
    holds, fails, _ = signal.of(run())
    assert not (holds & fails).any()
    return [YES if yes else NO if no else UNKNOWN for yes, no in zip(holds, fails, strict=True)]


def drawn(seed, kinds=(YES, NO, UNKNOWN)):
    return [kinds[place] for place in np.random.default_rng(seed).integers(len(kinds), size=TICKS)]


def both(one, other):
    return NO if NO in (one, other) else UNKNOWN if UNKNOWN in (one, other) else YES


def not_(one):
    return UNKNOWN if one is UNKNOWN else not one


def either(one, other):
    return not_(both(not_(one), not_(other)))


def some_of(values, complete):
    """Whether one of them holds, of those that there are."""
    return YES if YES in values else NO if complete and all(value is NO for value in values) else UNKNOWN


@pytest.mark.parametrize("seed", range(20))
def test_operators_are_those_of_a_logic_with_unknowns(seed):
    one, other = drawn(2 * seed), drawn(2 * seed + 1)
    a, b = planted(*one), planted(*other)
    pairs = list(zip(one, other, strict=True))
    assert read(a & b) == [both(*pair) for pair in pairs]
    assert read(a | b) == [either(*pair) for pair in pairs]
    assert read(~a) == [not_(value) for value in one]
    assert read(a.implies(b)) == [either(not_(first), second) for first, second in pairs]


@pytest.mark.parametrize(("seed", "ahead"), [*product(range(10), (0, 1, 3, 9))])
def test_what_follows_is_looked_at_as_far_as_it_reaches(seed, ahead):
    values = drawn(seed)
    windows = [(values[tick : tick + ahead + 1], tick + ahead < TICKS) for tick in range(TICKS)]
    assert read(planted(*values).eventually(ahead * DT)) == [some_of(*window) for window in windows]
    opposite = [([not_(value) for value in window], complete) for window, complete in windows]
    assert read(planted(*values).always(ahead * DT)) == [not_(some_of(*window)) for window in opposite]


@pytest.mark.parametrize("seed", range(30))
def test_until_holds_up_to_a_tick_in_which_the_other_does(seed):
    one, other = drawn(2 * seed, (YES, NO)), drawn(2 * seed + 1, (YES, NO, NO, NO))

    def expected(tick):
        for later in range(tick, TICKS):
            if other[later]:
                return YES
            if not one[later]:
                return NO
        return UNKNOWN

    assert [value or UNKNOWN for value in read(planted(*one).until(planted(*other)))] == [
        expected(tick) or UNKNOWN for tick in range(TICKS)
    ]
    fails = planted(*one).until(planted(*other)).of(run()).fails
    assert [bool(each) for each in fails] == [expected(tick) is NO for tick in range(TICKS)]


def test_a_premise_that_never_holds_puts_nothing_to_the_test():
    never, holds = planted(*[NO] * TICKS), planted(*[YES] * TICKS)
    found = always(never.implies(holds))(run())
    assert (found.verdict, found.says) == ("vacuous", "no tick puts it to the test")
    once = planted(*[NO] * 3, YES, *[NO] * 3)
    found = always(once.implies(holds))(run())
    assert (found.verdict, found.says) == ("pass", "in all of 1 ticks")
    found = always(once.implies(~holds))(run())
    assert (found.verdict, found.tick) == ("fail", 3)


def test_what_fails_is_the_first_tick_and_says_why():
    found = always(planted(YES, YES, NO, YES, NO, YES, YES))(run())
    assert (found.verdict, found.tick) == ("fail", 2)
    assert found.says == "at 0.2 s (tick 2) it does not hold; tick 2 is so"


@pytest.mark.parametrize(("since", "end", "tick"), [(0.3, None, 4), (0.0, 0.1, None), (0.0, 0.2, 2)])
def test_always_looks_at_its_span_only_both_ends_included(since, end, tick):
    found = always(planted(YES, YES, NO, YES, NO, YES, YES), since=since, until=end)(run())
    assert (found.verdict, found.tick) == ("pass" if tick is None else "fail", tick)


def test_eventually_says_from_when_or_the_last_tick_it_had():
    found = eventually(planted(NO, UNKNOWN, YES, *[NO] * 4))(run())
    assert (found.verdict, found.says) == ("pass", "from 0.2 s (tick 2) on")
    found = eventually(planted(YES, NO, *[NO] * 5), since=0.1, within=0.3)(run())
    assert (found.verdict, found.tick) == ("fail", 4)
    assert eventually(planted(*[UNKNOWN] * TICKS))(run()).verdict == "vacuous"


def test_until_fails_where_it_stops_too_early_or_nothing_comes():
    calm, shaken = planted(YES, YES, NO, NO, YES, YES, YES), planted(NO, NO, NO, YES, NO, NO, NO)
    found = until(calm, shaken)(run())
    assert (found.verdict, found.tick) == ("fail", 2)
    assert until(calm, planted(NO, NO, YES, *[NO] * 4))(run()).says == "up to 0.2 s (tick 2)"
    found = until(planted(*[YES] * TICKS), planted(*[NO] * TICKS))(run())
    assert (found.verdict, found.tick, found.says) == ("fail", 6, "at 0.6 s (tick 6) planted has never held")
    assert until(calm, shaken, since=0.3, within=0.1)(run()).verdict == "pass"


@pytest.mark.parametrize("made", [always, eventually, lambda signal, since: until(signal, signal, since=since)])
def test_a_run_that_ends_before_tells_nothing(made):
    assert made(planted(*[YES] * TICKS), since=4.0)(run()).verdict == "vacuous"


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (lambda signal: always(signal, since=np.nan), "always: since is nan: give finite seconds, at least 0"),
        (lambda signal: always(signal, until=np.inf), "always: until is inf: give finite seconds, at least 0"),
        (lambda signal: eventually(signal, within=-1), "eventually: within is -1: give finite seconds, at least 0"),
        (lambda signal: until(signal, signal, within=-1), "until: within is -1: give finite seconds, at least 0"),
        (lambda signal: signal.eventually(np.nan), "eventually: within is nan: give finite seconds, at least 0"),
        (lambda signal: signal.always(-1), "always: lasting is -1: give finite seconds, at least 0"),
        (lambda _: quantity("error") < np.inf, "error < inf: give a finite number"),
        (lambda _: quantity("error") < True, "error < True: give a finite number"),
        (lambda _: quantity("eror"), "no quantity 'eror'; did you mean 'error'?"),
    ],
)
def test_what_could_say_nothing_is_not_made(made, says):
    with pytest.raises(ValueError, match=f"^{re.escape(says)}"):
        made(planted(*[YES] * TICKS))
    with pytest.raises(TypeError, match="is no signal: give one, like"):
        always(0.3)


# ---- quantities


def test_every_quantity_is_a_number_of_each_tick_of_a_run():
    flown = evidence("agents.estimator=ga-rkf")
    for one in QUANTITIES.values():
        values = one.values(flown)
        assert values.shape == (flown.ticks,)
        assert np.isfinite(values).any() or one.name == "nis"


def test_quantities_are_what_they_say():
    flown, links = evidence("agents.estimator=ga-rkf"), evidence().plan.world.links
    np.testing.assert_array_equal(quantity("error").values(flown), flown.error)
    np.testing.assert_array_equal(quantity("nees").values(flown), FlownRun.of(flown).metric("nees"))
    assert quantity("input").values(flown)[9] == np.linalg.norm(flown.arrays["input"][9], axis=1).max()
    assert quantity("psi").values(flown)[9] == np.nanmax(flown.arrays["psi"][9])
    newest = flown.arrays["newest"]
    silent = tampered(flown, newest=np.where(np.arange(len(links)) == 3, -1, newest).astype(np.int32))
    np.testing.assert_allclose(quantity("age").values(silent), flown.seconds + flown.dt)
    assert quantity("connectivity").values(tampered(flown, newest=np.full_like(newest, -1))).max() == pytest.approx(0)
    # A number that is none is beyond every level; where nothing is, nothing is known.
    lost = tampered(flown, error=np.where(np.arange(flown.ticks) == 5, np.nan, flown.error))
    assert always(quantity("error") < 1e9)(lost).tick == 5
    assert (
        always(quantity("psi") < 1e9)(tampered(flown, psi=np.full_like(flown.arrays["psi"], np.nan))).verdict
        == "vacuous"
    )


def test_a_quantity_of_ones_own():
    flown = evidence()
    late = Quantity("late", "s", "the time", lambda one: one.seconds)
    found = always(late < 2.0)(flown)
    assert (found.verdict, found.tick) == ("fail", 40)
    assert found.says == "at 2 s (tick 40) it does not hold; the late is 2 s"
    assert always((late > 1.0).implies(late >= 1.0))(flown).verdict == "pass"
    with pytest.raises(UserCodeError, match=r"wrong: a quantity must be numbers \(T,\) = \(80,\), got float64 \(3,\)"):
        always(Quantity("wrong", "", "", lambda _: np.zeros(3)) < 1)(flown)


# ---- in words


@pytest.mark.parametrize(
    ("words", "made"),
    [
        ("always(error < 2, since=1)", always(quantity("error") < 2, since=1)),
        ("eventually(error < 0.2, within=3)", eventually(quantity("error") < 0.2, within=3)),
        (
            "always((error > 1).implies((error <= 1).eventually(within=2)))",
            always((quantity("error") > 1).implies((quantity("error") <= 1).eventually(within=2))),
        ),
        (
            "until((psi >= 0) & ~(age > 9), (error < 0.5) | (nees < 0))",
            until((quantity("psi") >= 0) & ~(quantity("age") > 9), (quantity("error") < 0.5) | (quantity("nees") < 0)),
        ),
        (
            "always((error < 9).until(error < 0.5), until=0)",
            always((quantity("error") < 9).until(quantity("error") < 0.5), until=0),
        ),
        (
            "always((error < 3).always(lasting=0.5), until=1)",
            always((quantity("error") < 3).always(lasting=0.5), until=1),
        ),
    ],
)
def test_what_is_written_in_words_is_what_python_makes(words, made):
    said = invariants.parse(words)
    assert said.name == made.name
    assert said(evidence()) == made(evidence())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("always(eror < 2)", "no quantity 'eror'; did you mean 'error'?"),
        (
            "always(error < 2 & psi < 1)",
            "is no signal: compare a quantity with a number, in brackets, like (error < 0.3)",
        ),
        ("always(0 < error < 2)", "is no signal"),
        ("always(error)", "is no signal"),
        ("always((error < 2).sometimes(3))", "is no signal"),
        ("always((error < 2).eventually(within='x'))", "is no number"),
        ("always(__import__('os').system('true'))", "is no signal"),
        ("error < 2", "is no checker"),
        ("below('neess', 3)", "no metric 'neess'"),
        ("below('nees', 'much')", "'much' is no number"),
        ("below(nees, 3)", "nees is no name of a metric: write it in quotes"),
        ("bounded('5')", "'5' is no number"),
        ("always(error < nan)", "nan is no number"),
        ("always((error < 1).eventually(within=2, within=3))", "a word is given twice"),
    ],
)
def test_what_is_no_signal_in_words_is_one_line(words, says):
    with pytest.raises(ScenarioError) as caught:
        invariants.parse(words)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "write",
    [
        lambda error: 1 < error < 4,
        lambda error: (error < 0.0001) and (error < 5),
        lambda error: (error < 5) or (error < 0.0001),
        lambda error: not error < 5,
    ],
    ids=["chained", "and", "or", "not"],
)
def test_words_of_python_that_would_drop_one_half_of_a_signal_are_refused(write):
    with pytest.raises(TypeError, match=r"is no truth value: write & for and, \| for or, ~ for not, and \(1 < q\) & "):
        always(write(quantity("error")))
