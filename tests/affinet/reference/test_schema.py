"""The JSON schemas: what the loader takes fits, what they refuse the loader refuses too, and every key says what it is."""

import tomllib
from importlib import resources

import jsonschema
import pytest
from pydantic import ValidationError

from affinet.reference import schema
from affinet.scenario import files, profiles
from affinet.scenario.sections import Scenario
from affinet.studies.study import Study

SCENARIO, STUDY = schema.scenario(), schema.study()


def good():
    return tomllib.loads((resources.files("affinet.shipped") / "scenarios" / "partition.toml").read_text())


def changed(path, value):
    """The scenario `partition` with a value at a place, or without what is there."""
    whole = table = good()
    *above, last = path
    for step in above:
        table = table.setdefault(step, {}) if isinstance(step, str) else table[step]
    if value is None:
        del table[last]
    else:
        table[last] = value
    return whole


def test_the_schemas_are_schemas():
    for made in (SCENARIO, STUDY):
        jsonschema.Draft202012Validator.check_schema(made)


@pytest.mark.parametrize("name", files.shipped("scenarios"))
def test_every_shipped_scenario_fits(name):
    jsonschema.validate(files.read(name, "scenarios", "scenario").says, SCENARIO)


@pytest.mark.parametrize("name", files.shipped("studies"))
def test_every_shipped_study_fits(name):
    jsonschema.validate(files.read(name, "studies", "study").says, STUDY)


WRONG = [
    (("tim",), {}),
    (("time",), None),
    (("time", "dt"), "0.01"),
    (("time", "dt"), 0.0),
    (("time", "patience"), 1.0),
    (("time", "mode"), "fast"),
    (("network", "availability"), 1.5),
    (("network", "availabilty"), 0.5),
    (("network", "profiles"), {"mine": {"loss": [{"model": "bernoulli"}]}}),
    (("network", "profiles"), {"mine": {"loss": [{"model": "gilbert", "loss": 0.1, "burst": 0.5}]}}),
    (("network", "profiles"), {"mine": {"delay": {"model": "normal", "mean": -1.0}}}),
    (("seed",), -1),
    (("timeline", 0, "verb"), "cutt"),
    (("timeline", 0, "at"), "soon"),
    (("timeline", 0, "groups"), "thirds"),
    (("timeline", 1, "agents"), []),
    (("timeline", 1, "agents"), [[5]]),
    (("record", "every"), 0),
    (("agents", "per_process"), 1.5),
]


@pytest.mark.parametrize(("path", "value"), WRONG, ids=lambda value: str(value))
def test_what_the_loader_refuses_does_not_fit(path, value):
    wrong = changed(path, value)
    with pytest.raises(ValidationError):
        Scenario.model_validate(wrong)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(wrong, SCENARIO)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("agents", "estimator"), "rkff"),
        (("agents", "parameters"), {"rkf": {"sigma": 1.0}}),
        (("agents", "parameters"), {"rkf": {"sigma_w": "much"}}),
        (("formation", "preset"), "zhao8"),
    ],
)
def test_names_and_parameters_that_there_are_not_do_not_fit_either(path, value):
    jsonschema.validate(good(), SCENARIO)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(changed(path, value), SCENARIO)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("agents", "estimator"), "my_module:Mine"),
        (("agents", "parameters"), {"my_module:Mine": {"gain": 2}}),
        (("network", "profiles"), {"mine": {"loss": [{"model": "my_module:Loss", "reach": 8.0}]}}),
        (("network", "profiles"), {"mine": {"delay": {"model": "table", "table": "delays.csv"}}}),
        (("timeline", 0, "groups"), "halves"),
        (("timeline", 2), {"verb": "lose", "at": 1.0, "loss": 0.5, "links": "all"}),
    ],
)
def test_what_is_the_users_own_fits(path, value):
    said = changed(path, value)
    Scenario.model_validate(said)
    jsonschema.validate(said, SCENARIO)


@pytest.mark.parametrize(
    ("key", "value"),
    [("figure", "pie"), ("quantity", "eror"), ("claims", [{"says": "x", "check": "is"}]), ("axis", [])],
)
def test_a_wrong_study_does_not_fit(key, value):
    wrong = files.read("bursts", "studies", "study").says | {key: value}
    with pytest.raises(ValidationError):
        Study.model_validate(wrong)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(wrong, STUDY)


def tables(made):
    yield "", made
    yield from made["$defs"].items()


@pytest.mark.parametrize("made", [SCENARIO, STUDY], ids=["scenario", "study"])
def test_every_key_says_what_it_is(made):
    silent = [
        f"{name}.{key}"
        for name, table in tables(made)
        for key, says in table.get("properties", {}).items()
        if not says.get("description") and key not in ("verb", "model")  # which tell tables apart
    ]
    assert silent == []


def test_bounds_and_defaults_are_in_it():
    time = SCENARIO["$defs"]["TimeSection"]["properties"]
    assert (time["patience"]["minimum"], time["patience"]["maximum"], time["patience"]["default"]) == (2.0, 3600.0, 3.0)
    assert time["dt"]["exclusiveMinimum"] == 0.0
    assert time["dt"]["description"] == "tick [s]"
    assert SCENARIO["$defs"]["Gust"]["properties"]["velocity"]["description"].endswith(" [m/s]")
    assert set(profiles.LOSSES) <= {
        word
        for table in SCENARIO["$defs"].values()
        for word in [table.get("properties", {}).get("model", {}).get("const")]
        if word
    }
