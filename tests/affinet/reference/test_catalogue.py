"""What there is: of each kind all, with parameters that have a line, a unit where there is one, and a default."""

import importlib.metadata
import json
import sys
from importlib.metadata import EntryPoint

import pytest

from affinet.cli.commands import main
from affinet.cli.options.beginning import LISTED
from affinet.planning import registry
from affinet.reference import catalogue
from affinet.reference.docstrings import first_line, parameters_of, unit_of
from affinet.scenario import loading, profiles, verbs
from affinet.studies import checks, study
from affinet.verdicts.invariants import NAMED
from netem.impairments import own

FOUND = {kind: {entry.name: entry for entry in made()} for kind, made in catalogue.KINDS.items()}
# Parameters that are numbers, and have no unit: shares, probabilities, counts, factors, and levels of what has its own.
BARE = {
    "estimators": {"epsilon", "stay", "coefficients", "coefficient", "h", "alpha", "k", "gate"},
    "laws": {"relaxation"},
    "checkers": {"share", "level", "within"},
    "verbs": {"loss", "p", "matrix", "rate", "times"},
}


def test_the_kinds_are_those_of_the_command():
    assert tuple(catalogue.KINDS) == LISTED


def test_all_of_each_kind_is_there():
    assert list(FOUND["scenarios"]) == loading.shipped()
    assert list(FOUND["estimators"]) == registry.names(registry.ESTIMATORS)
    assert list(FOUND["laws"]) == registry.names(registry.LAWS)
    assert list(FOUND["profiles"]) == list(profiles.presets())
    assert {*profiles.LOSSES, "delay", "duplicate", "reorder", "corrupt", "rate"} == set(FOUND["impairments"])
    assert [*verbs.VERBS, "(any)"] == list(FOUND["verbs"])
    assert {*NAMED, "below", "always", "eventually"} == set(FOUND["checkers"])
    assert list(FOUND["studies"]) == study.shipped()
    assert list(FOUND["figures"]) == ["curves", "map", "sweep", "indicator", "paths"]
    assert set(study.Study.model_fields["figure"].annotation.__args__) == set(checks.FIGURES)


@pytest.mark.parametrize("kind", catalogue.KINDS)
def test_everything_says_what_it_is(kind):
    assert [entry.name for entry in FOUND[kind].values() if not entry.says] == []
    shown = ("scenarios", "profiles", "studies")  # whose values speak for themselves
    silent = [
        f"{entry.name}.{one.name}"
        for entry in FOUND[kind].values()
        for one in entry.parameters
        if kind not in shown and not (one.says or one.name == entry.name)
    ]
    assert silent == []


@pytest.mark.parametrize("kind", BARE)
def test_numbers_have_a_unit_where_there_is_one(kind):
    numbers = [
        (entry.name, one)
        for entry in FOUND[kind].values()
        for one in entry.parameters
        if one.kind in ("number", "list", "whole number") and one.name not in BARE[kind]
    ]
    assert [f"{name}.{one.name}" for name, one in numbers if not one.unit and one.kind == "number"] == []
    assert {one.unit for _, one in numbers} >= {
        "estimators": {"m", "m/s", "m/s2", "s", "ticks"},
        "laws": {"1/s", "1/s2"},
    }.get(kind, {"s"})


def test_parameters_have_kind_unit_and_default():
    sigma_w = next(one for one in FOUND["estimators"]["ga-rkf"].parameters if one.name == "sigma_w")
    assert (sigma_w.kind, sigma_w.unit, sigma_w.default, sigma_w.required) == ("number", "m/s2", 0.5, False)
    geometry = next(one for one in FOUND["estimators"]["ga-rkf"].parameters if one.name == "geometry")
    assert (geometry.kind, catalogue.default_of(geometry)) == ("ral | conral", '"conral"')
    velocity = next(one for one in FOUND["verbs"]["gust"].parameters if one.name == "velocity")
    assert catalogue.default_of(velocity) == "required, m/s"
    assert {one.name for one in FOUND["verbs"]["(any)"].parameters} >= {"at", "until", "every"}
    told = {one.name: catalogue.default_of(one) for one in FOUND["scenarios"]["corridor"].parameters}
    assert (told["time.dt"], told["network.availability"], told["agents.estimator"]) == ("0.01 s", "0.7", '"ga-rkf"')
    until = next(one for one in FOUND["checkers"]["always"].parameters if one.name == "until")
    assert until.says == "Up to when, in seconds; None to the end of the run"
    (graph, *_) = FOUND["studies"]["bursts"].parameters
    assert (graph.name, catalogue.default_of(graph)) == ("graph", "zhao7, hexa10")


@pytest.mark.parametrize(
    ("says", "unit"),
    [
        ("Gain, per second.", "1/s"),
        ("Of an acceleration, in metres per second squared.", "m/s2"),
        ("Of what is spent, in metres squared per second.", "m2/s"),
        ("kappa_mu in 1/s^(m - mu).", "1/s^(m - mu)"),
        ("A share of those that come in metresque ways.", ""),
        ("How many.", ""),
    ],
)
def test_units_are_read_from_words(says, unit):
    assert unit_of(says) == unit


def test_what_a_base_says_of_a_parameter_is_said():
    def made(level: float, by: float = 0.0) -> None:
        """It holds.

        And more.

        Parameters
        ----------
        level, by
            Both, in metres. And more.

        Returns
        -------
        nothing
            At all.
        """

    level, by = parameters_of(made)
    assert (level.says, level.unit, level.required) == ("Both, in metres", "m", True)
    assert (by.says, by.default) == ("Both, in metres", 0.0)
    assert first_line(made) == "It holds."
    assert first_line(own.OwnLoss).startswith("A loss of a user's own")


OWN = '''
from dataclasses import dataclass


@dataclass(frozen=True)
class Told:
    """One that says what it is.

    Parameters
    ----------
    reach
        How far, in metres.
    """

    reach: float = 8.0


@dataclass(frozen=True)
class Silent:
    gain: "int" = 2
'''


def test_what_installed_packages_offer_is_there_and_what_cannot_be_loaded_says_why(tmp_path, monkeypatch, capsys):
    (tmp_path / "offered_here.py").write_text(OWN)
    monkeypatch.syspath_prepend(str(tmp_path))
    points = [EntryPoint(name, f"offered_here:{name}", registry.ESTIMATORS) for name in ("Told", "Silent", "Gone")]
    there = importlib.metadata.entry_points

    def entry_points(*, group):
        return [*there(group=group), *(points if group == registry.ESTIMATORS else [])]

    monkeypatch.setattr(catalogue, "entry_points", entry_points)
    found = {entry.name: entry for entry in catalogue.estimators()}
    assert found["Told"].says == "One that says what it is."
    assert [(one.name, one.unit, one.default) for one in found["Told"].parameters] == [("reach", "m", 8.0)]
    assert (found["Silent"].says, found["Silent"].parameters[0].default) == ("", 2)
    assert found["Gone"].says.startswith("cannot be loaded: offered_here has no 'Gone'")
    assert main(["list", "estimators", "Told"]) == 0
    assert "reach  8.0 m  How far, in metres" in capsys.readouterr().out
    del sys.modules["offered_here"]


def test_one_is_asked_for_by_name_and_a_stranger_is_one_line(capsys):
    assert main(["list", "verbs", "gust", "--json"]) == 0
    (gust,) = json.loads(capsys.readouterr().out)["verbs"]
    assert (gust["name"], gust["parameters"][1]["unit"]) == ("gust", "m/s")
    assert main(["list", "verbs", "gusts"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("gusts: none of the verbs; did you mean 'gust'? there are cut, partition, ")


SPRING = '''
from dataclasses import dataclass
from affinet import Law


@dataclass(frozen=True)
class Spring(Law):
    """Pull toward where one should be.

    Parameters
    ----------
    gain
        How fast, per second.
    """

    gain: float

    def init(self, brief):
        return None

    def command(self, *given):
        return None
'''


def test_a_class_of_ones_own_is_described_from_the_working_directory(tmp_path, monkeypatch, capsys):
    module = "pull_that_is_listed"
    name = f"{module}:Spring"
    (tmp_path / f"{module}.py").write_text(SPRING)
    monkeypatch.chdir(tmp_path)
    assert main(["list", "laws", name, "--json"]) == 0
    ((entry,),) = json.loads(capsys.readouterr().out).values()
    assert (entry["name"], entry["says"]) == (name, "Pull toward where one should be.")
    (gain,) = entry["parameters"]
    assert (gain["name"], gain["required"], gain["unit"]) == ("gain", True, "1/s")
    assert main(["list", "laws", name]) == 0
    assert capsys.readouterr().out.splitlines()[0] == name
    assert main(["list", "estimators", name]) == 3
    assert (
        "Spring: has no method channels, sense, fuse: Estimator in docs/estimators.md says" in capsys.readouterr().err
    )
    assert main(["list", "laws", f"{name}s"]) == 2
    assert "has no 'Springs'" in capsys.readouterr().err
