"""What a scenario file says, changed by texts, tables and keywords, and by estimators and laws that are objects."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, make_dataclass
from pathlib import Path

import numpy as np
import pytest

import affinet
from affinet.scenario import loading, overrides
from affinet.scenario.sections import Scenario


def said(*given, **settings):
    return loading.load("corridor", given, **settings).model_dump(mode="json")


AS_TEXTS = said("agents.estimator=rkf", "network.availability=0.5", "seed=7", "time.duration=2", "time.dt=0.02")


FORMS = {
    "keywords": lambda: said(estimator="rkf", availability=0.5, seed=7, duration=2, dt=0.02),
    "one table": lambda: said({"estimator": "rkf", "availability": 0.5, "seed": 7, "duration": 2, "dt": 0.02}),
    "tables and keywords": lambda: said(
        {"agents.estimator": "rkf", "network": {"availability": 0.5}}, seed=7, time={"duration": 2, "dt": 0.02}
    ),
    "numbers of NumPy": lambda: said(
        "agents.estimator=rkf",
        {"network.availability": np.float64(0.5), "time.dt": np.longdouble(0.02)},
        seed=np.int64(7),
        time={"duration": np.array(2.0)},
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_what_texts_say_tables_and_keywords_say_too(form):
    assert FORMS[form]() == AS_TEXTS


def test_every_short_name_is_a_key_and_none_is_that_of_a_table():
    assert said(law="static")["agents"]["law"] == "static"
    taken = {"name", "overrides", "folder", "scenario", "runtime", "out"}
    assert not taken & Scenario.model_fields.keys()
    assert overrides.SHORT.keys() & Scenario.model_fields.keys() == {"seed"}


def test_a_table_adds_to_what_is_there_and_a_list_takes_its_place():
    before = said()
    after = said(agents={"parameters": {"rkf": {"sigma": 2.0}}}, network={"profiles": {"mine": {"loss": []}}})
    assert after["agents"]["parameters"] == {**before["agents"]["parameters"], "rkf": {"sigma": 2.0}}
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    given = said({"formation": {"preset": None, "nodes": nodes, "edges": ("1-2", "2-3", "1-3"), "leaders": [1, 2, 3]}})
    assert given["formation"]["nodes"] == nodes.tolist()
    assert given["formation"]["edges"] == ["1-2", "2-3", "1-3"]


def test_dots_part_a_key_at_the_outermost_level_alone():
    parameters = {"a.b:Own": {"gain": 1.0}}
    assert said(agents={"parameters": parameters})["agents"]["parameters"].items() >= parameters.items()
    assert said({'agents.parameters."a.b:Own".gain': 1.0})["agents"]["parameters"].items() >= parameters.items()


def test_of_two_that_give_a_key_the_later_holds_and_keywords_come_last():
    assert said("seed=2", {"seed": 3})["seed"] == 3
    assert said({"seed": 3}, "seed=2")["seed"] == 2
    assert said({"seed": 3}, "seed=2", seed=4)["seed"] == 4


def test_another_sensor_stands_in_place_of_that_of_the_file():
    given = said(sensing={"sigma_range": 0.1, "sigma_bearing": 0.02})["sensing"]
    assert (given["sigma"], given["sigma_range"], given["sigma_bearing"]) == (None, 0.1, 0.02)


def test_a_path_is_whole_and_relative_to_where_it_is_asked_from(tmp_path):
    (tmp_path / "flight.csv").write_text("time,agent\n")
    given = loading.load("corridor", [{"recorded": {"flight": Path("flight.csv")}, "world": "recorded"}], tmp_path)
    assert given.recorded.flight == str(tmp_path / "flight.csv")


NEAR = "did you mean"
WRONG = {
    "a keyword": (lambda: said(estimater="rkf"), f"override estimater: no such key; {NEAR} 'estimator'? there are "),
    "a table": (lambda: said(networks={}), f"override networks: no such key; {NEAR} 'network'? there are "),
    "a key": (lambda: said({"network.delai": 1}), f"override: network.delai: unknown key; {NEAR} 'delay_ticks'?"),
    "a key in a table": (lambda: said(network={"delai": 1}), f"override: network.delai: unknown key; {NEAR} 'delay_t"),
    "a text for a number": (lambda: said(availability="0.5"), "override: network.availability: should be a number, "),
    "a table for a number": (lambda: said(seed={"a": 1}), "override seed.a=1: seed is not a table"),
    "what is no value": (lambda: said(seed=object()), "override seed: <object object at "),
    "a class": (lambda: said(estimator=Filter), "agents.estimator: Filter is a class: give an object, Filter(...)"),
    "no dataclass": (lambda: said(law=5), "agents.law: 5 is no name, and no object of a dataclass of parameters"),
    "of a function": (
        lambda: said(law=of_a_function()),
        "agents.law: {}:of_a_function.<locals>.Inner does not lead to ",
    ),
    "of an older class": (
        lambda: said(law=older()),
        "agents.law: {}:Renewed does not lead to the class of this object",
    ),
    "an array": (lambda: said(law=Odd(np.ones(2))), "agents.law: {}:Odd: odd: is a ndarray, which a scenario cannot "),
    "a function": (lambda: said(law=Odd(len)), "agents.law: odd is <built-in function len>: a scenario says numbers, "),
    "another object": (
        lambda: said(law=Doubling(2.0)),
        "agents.law: {}:Doubling: made again of its parameters it has ",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_said_with_its_key_and_what_would_be_right(wrong):
    call, says = WRONG[wrong]
    with pytest.raises(affinet.ScenarioError, match=f"^{re.escape(says.format(__name__))}"):
        call()


# ---- objects


@dataclass(frozen=True)
class Inside:
    sigma: float = 1.0


@dataclass(frozen=True)
class Filter:
    gain: float = 1.0
    weights: tuple[float, ...] = (1.0, 2.0)
    prior: Inside = Inside()
    names: list[str] = field(default_factory=list)
    how: Callable[[float], float] = abs
    kept: object = field(init=False, default_factory=object)


@dataclass(frozen=True)
class Odd:
    odd: np.ndarray


@dataclass
class Doubling:
    gain: float

    def __post_init__(self):
        self.gain *= 2.0


def renewed():
    """A class as a cell of a notebook defines it, and defines it again."""
    return make_dataclass("Renewed", [("gain", float, 1.0)], namespace={"__module__": __name__}, frozen=True)


Renewed = renewed()


def older():
    return renewed()()


def of_a_function():
    @dataclass(frozen=True)
    class Inner:
        gain: float = 1.0

    return Inner()


@pytest.mark.parametrize(
    ("given", "parameters"),
    [
        (Filter(), {}),
        (Filter(gain=2.0), {"gain": 2.0}),
        (Filter(2.0, (3.0,), Inside(0.5), ["a"]), {"gain": 2.0, "weights": [3.0], "prior": {"sigma": 0.5}, "names": ["a"]}),
    ],
    ids=["as by default", "one parameter", "all of them"],
)  # fmt: skip
def test_an_object_is_the_name_of_its_class_and_its_parameters(given, parameters):
    agents = said(estimator=given)["agents"]
    assert agents["estimator"] == f"{__name__}:Filter"
    assert agents["parameters"][f"{__name__}:Filter"] == parameters


def test_the_parameters_of_an_object_are_all_there_are():
    name = f"{__name__}:Filter"
    agents = said({"agents": {"parameters": {name: {"gain": 5.0}}}}, estimator=Filter(weights=(3.0,)))["agents"]
    assert agents["parameters"][name] == {"weights": [3.0]}
