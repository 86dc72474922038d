"""Every array of a run is described: its axes, its unit, what it is, and how it says that something is not there."""

from dataclasses import fields, replace

import pytest
from flying import plan_of

from affinet.planning import registry
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from netem.medium.verdict import Verdict
from world.books import described
from world.books.described import AGENT, AXIS, CHANNEL, COLUMN, LINK, PAIR, ROW, SLOT, TIME, VERDICT
from world.books.history import History, Moments


def test_every_array_is_described_and_nothing_else():
    kept = vars(History(replace(plan_of("corridor").world, ticks=0), 4, {}))
    assert described.BY_TICK.keys() == kept.keys() - {"ticks", "reports"}
    assert described.BY_TICK.keys() == {field.name for field in fields(Moments)} - {"first", "reports"}


@pytest.mark.parametrize("scenario", loading.shipped())
def test_what_is_described_is_what_is_flown(scenario):
    plan = plan_of(scenario, "time.duration=0.1")
    arrays, links, dimension = rehearse(plan).arrays, plan.world.links, plan.world.formation.dimension
    sizes = {
        TIME: len(arrays["error"]),
        AGENT: links.agents,
        SLOT: links.present.shape[1],
        LINK: len(links),
        CHANNEL: len(plan.channels),
        VERDICT: len(Verdict),
        AXIS: dimension,
        PAIR: dimension * (dimension + 1) // 2,
        ROW: dimension,
        COLUMN: dimension,
    }
    of_run = described.of_run(plan.world, plan.reports)
    assert of_run.keys() == arrays.keys()
    for name, one in of_run.items():
        shape = arrays[name][: sizes[TIME]].shape
        assert len(shape) == len(one.axes), name
        assert [sizes.get(axis, size) for axis, size in zip(one.axes, shape, strict=True)] == [*shape], name
        assert (arrays[name].dtype.kind, bool(one.says)) == (one.kind, True), name
        assert one.where is None or arrays[one.where].dtype == bool


EXAMPLES = {"target": "target", "jor": "localization", "silent-kf": "rigid", "joint-kf": "rigid", "edge-kf": "rigid"}


@pytest.mark.parametrize("estimator", registry.names(registry.ESTIMATORS))
def test_what_estimators_of_affinet_report_is_described(estimator):
    scenario = EXAMPLES.get(estimator, "corridor")
    plan = plan_of(scenario, f"agents.estimator={estimator}", "time.duration=0.1")
    for name in plan.reports:
        assert name in described.REPORTS
        assert described.of_run(plan.world, plan.reports)[name].axes == (TIME, AGENT, *described.REPORTS[name].axes)


def test_a_report_of_another_shape_under_a_known_name_is_one_of_the_users_own():
    world = plan_of("corridor").world
    reports = {"place": (5,), "nis": (), "theta": (2, 3), "mine": (4, 4)}
    of_run = described.of_run(world, reports)
    assert of_run["place"].axes == (TIME, AGENT, "place_1")
    assert of_run["nis"].axes == (TIME, AGENT)
    assert of_run["theta"].axes == (TIME, AGENT, "theta_1", "theta_2")
    assert of_run["mine"].says == "mine, as the estimator reports it"
    assert described.of_run(world, {"place": (2,)})["place"].axes == (TIME, AGENT, AXIS)


@pytest.mark.parametrize(
    ("overrides", "name", "unit"),
    [
        ((), "input", "m/s"),
        (("dynamics.model=double-integrator", "agents.law=double-varying-velocity"), "input", "m/s2"),
        ((), "measured", "m"),
        (("sensing.sigma_direction=0.01", "agents.estimator=edge-kf"), "measured", "1"),
    ],
)
def test_a_unit_is_that_of_the_bodies_and_the_sensor(overrides, name, unit):
    plan = plan_of("corridor", "time.duration=0.1", *overrides)
    assert described.of_run(plan.world, plan.reports)[name].unit == unit


def test_every_axis_that_is_not_of_a_report_is_explained():
    named = {axis for one in described.BY_TICK.values() for axis in one.axes}
    assert named <= described.AXES.keys()
