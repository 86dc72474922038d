"""Checkers by the words that name them."""

import inspect

import pytest
from judged import evidence

from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import checkers, invariants, pursued, temporal


@pytest.mark.parametrize(
    ("text", "checker"),
    [
        ("bounded(5)", checkers.bounded(5)),
        ("bounded(level=0.5)", checkers.bounded(0.5)),
        ("bounded(1e6)", checkers.bounded(1e6)),
        ("converged(0.1, by=2)", checkers.converged(0.1, by=2)),
        ("converged(by=2.5, level=0.1)", checkers.converged(0.1, by=2.5)),
        ("recovers(0.1, within=5)", checkers.recovers(0.1, within=5)),
        ("never_heard_across_a_cut()", checkers.never_heard_across_a_cut()),
        ("consistent()", checkers.consistent()),
        ("consistent(0.95, since=1)", checkers.consistent(0.95, since=1)),
        ("collision_free(0.2)", checkers.collision_free(0.2)),
        ("agreement(1, by=2)", checkers.agreement(1, by=2)),
        ("energy(1000)", checkers.energy(1000)),
    ],
)
def test_every_word_makes_its_checker(text, checker):
    parsed = invariants.parse(text)
    assert parsed.name == checker.name
    assert parsed(evidence()) == checker(evidence())


def test_there_is_a_word_for_every_checker():
    made = {
        name
        for module in (checkers, pursued, temporal)
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if not name.startswith("_") and inspect.signature(function).return_annotation == "Checker"
    }
    assert set(invariants.NAMED) == made


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("bounded(1) & energy(2)", "(bounded(1) & energy(2))"),
        ("bounded(1) | energy(2)", "(bounded(1) | energy(2))"),
        ("~bounded(1)", "~bounded(1)"),
        ("~~bounded(1)", "~~bounded(1)"),
        ("bounded(1) | bounded(2) & ~bounded(3)", "(bounded(1) | (bounded(2) & ~bounded(3)))"),
        ("(bounded(1) | bounded(2)) & bounded(3)", "((bounded(1) | bounded(2)) & bounded(3))"),
    ],
)
def test_signs_join_checkers_as_python_binds_them(text, name):
    assert invariants.parse(text).name == name


@pytest.mark.parametrize(
    ("text", "verdict"),
    [
        ("bounded(100) & energy(1e9)", "pass"),
        ("bounded(100) & energy(1e-9)", "fail"),
        ("bounded(100) | energy(1e-9)", "pass"),
        ("~bounded(100)", "fail"),
        ("~bounded(1e-9)", "pass"),
        ("never_heard_across_a_cut() & bounded(100)", "vacuous"),
    ],
)
def test_what_is_joined_is_judged_together(text, verdict):
    assert invariants.parse(text)(evidence()).verdict == verdict


REFUSED = {
    "nothing": "",
    "half a call": "bounded(5",
    "no call": "bounded",
    "a number": "5",
    "another word": "bound(5)",
    "a checker that numbers do not describe": "always(5)",
    "too few": "converged(0.1)",
    "too many": "bounded(1, 2)",
    "an unknown parameter": "bounded(5, since=1)",
    "text for a number": "bounded('5')",
    "nothing for a number": "bounded(None)",
    "a list for a number": "bounded([5])",
    "a name for a number": "bounded(nan)",
    "an infinite level": "bounded(1e400)",
    "a level of nothing": "bounded(0)",
    "a level below nothing": "bounded(-1)",
    "a level that is no number": "~bounded(1e400 - 1e400)",
    "an infinite energy": "energy(1e400)",
    "a distance below nothing": "collision_free(-1)",
    "a time before the run": "converged(1, by=-5)",
    "a time after all runs": "converged(1, by=1e400)",
    "an infinite level of an agreement": "agreement(1e400)",
    "a time before the run for an agreement": "agreement(1, by=-1)",
    "a target within nothing": "found(0)",
    "an agreement before the run": "agreed(1, by=-1)",
    "an infinite level of places": "localized(1e400)",
    "a time before the run for places": "localized(1, by=-1)",
    "a recovery in less than no time": "recovers(1, within=-1)",
    "a recovery to an infinite level": "recovers(1e400, within=1)",
    "consistent before the run": "consistent(0.9, since=-1)",
    "more than all steps": "smooth(2)",
    "all steps": "smooth(1)",
    "unpacked": "bounded(*[5])",
    "unpacked by name": "bounded(**{'level': 5})",
    "and": "bounded(1) and bounded(2)",
    "not": "not bounded(1)",
    "minus": "-bounded(1)",
    "exclusive or": "bounded(1) ^ bounded(2)",
    "compared": "bounded(1) < bounded(2)",
    "two": "bounded(1), bounded(2)",
    "a statement": "x = bounded(1)",
}


@pytest.mark.parametrize("text", REFUSED.values(), ids=REFUSED.keys())
def test_what_names_no_checker_is_refused_with_all_there_are(text):
    with pytest.raises(ScenarioError) as refused:
        invariants.parse(text)
    said = str(refused.value)
    assert said.startswith(f"invariant {text!r}: ")
    for word in (
        "bounded(level)",
        "converged(level, by)",
        "never_heard_across_a_cut()",
        "consistent(level, within, since)",
    ):
        assert word in said
    assert "& | ~" in said
    assert all(name in said for name in invariants.NAMED)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('touch {trap}')",
        "bounded(__import__('os').system('touch {trap}'))",
        "bounded(level=open('{trap}', 'w').write('x'))",
        "bounded(1).check",
        "bounded(1).__class__",
        "checkers.bounded(1)",
        "bounded(1)(open('{trap}', 'w'))",
        "(lambda: bounded(1))()",
        "[bounded(1) for _ in open('{trap}', 'w').write('x')][0]",
        "(trap := bounded(1))",
        "bounded(1) if open('{trap}', 'w') else bounded(2)",
        "bounded(1) & open('{trap}', 'w')",
        "bounded(10**3)",
        "bounded(len('trap'))",
        "bounded(f'{{1}}')",
        "_built(1)",
        "parse('bounded(1)')",
    ],
)
def test_nothing_but_checkers_is_evaluated(text, tmp_path):
    trap = tmp_path / "trap"
    with pytest.raises(ScenarioError):
        invariants.parse(text.format(trap=trap))
    assert not trap.exists()


@pytest.mark.parametrize("text", ["~" * 5000 + "bounded(1)", f"bounded({'9' * 400})", "bounded(1j)"], ids=len)
def test_what_is_too_deep_too_large_or_complex_is_refused(text):
    with pytest.raises(ScenarioError):
        invariants.parse(text)
