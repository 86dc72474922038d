"""Runs of several plans in one batch: each is bit for bit the run alone, and plans that differ in anything else are refused."""

from dataclasses import fields, replace
from itertools import cycle

import numpy as np
import pytest
from flying import plan_of

from affinet.planning.plan import Plan
from affinet.runtimes.alike import BY_LINK, alike, same
from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.side_by_side import Flight, NotABatch, together
from affinet.studies.batch import fly_all, fly_together
from netem.impairments.delay import DelayLaw
from world.books.history import History

SHORT = ("time.dt=0.05", "time.duration=1")


def aired(profile):
    return 'network.profile="one"', f"network.profiles.one={{{profile}}}"


SPLIT = "network.coupled=false"
NARROW = 'network.links=[{links="%s",profile="late"}]'
LATE = 'network.profiles.late={delay={model="exponential",mean=0.08,correlation=0.5,order="kept"}}'
SCRIPT = (
    'timeline=[{verb="degrade",at=0.2,lasts=0.3,links=["2->4"],profile="worse"},{verb="lose",at=0.5,links=["all"],loss=0.4},'
    '{verb="kill",at=0.3,agents=[5]},{verb="restart",at=0.6,agents=[5],state="warm"}]'
)
WORSE = "network.profiles.worse={loss=[{model=%s}]}"
TOGETHER = {
    "availability": [(f"network.availability={share}",) for share in (0.4, 1.0, 0.8)],
    "bursts": [
        ("network.availability=0.7",),
        aired('loss=[{model="gilbert",loss=0.3,burst=4}]'),
        aired('loss=[{model="bernoulli",p=0.2},{model="markov",p13=0.1,p31=0.5,p32=0.2,p23=0.3,p14=0.05}]'),
        aired('loss=[{model="gilbert",loss=0.3,burst=4,step="packet"}]'),
        aired('loss=[{model="bursts",loss=0.2,lengths=[0.1,0.2,0.1,0.1,0.2,0.3]}]'),
    ],
    "channels apart": [
        (SPLIT, 'network.links=[{links="all",channels="sensing",availability=0.5}]'),
        (SPLIT, 'network.links=[{links="all",channels="comms",availability=0.6}]'),
        (SPLIT, "network.availability=0.9"),
    ],
    "copies and marks": [
        aired('duplicate=0.2,corrupt=[{kind="bias",p=0.2,by=0.2}]'),
        (*aired("reorder=0.1"), "network.availability=0.9"),
        aired('corrupt=[{kind="bit-flip",p=0.1},{kind="bias",p=0.1,by=0.3}],loss=[{model="bernoulli",p=0.1}]'),
    ],
    "delays of other links": [(LATE, NARROW % "2->4"), (LATE, NARROW % "leaders", "network.availability=0.8")],
    "faults": [
        (SCRIPT, WORSE % '"bernoulli",p=0.9'),
        (SCRIPT, WORSE % '"gilbert",loss=0.5,burst=3', "network.availability=0.6"),
    ],
    "a filter": [('agents.estimator="rkf"', f"network.availability={share}") for share in (0.3, 1.0)],
}
SEEDS = (1, 7), (7,), (2**63 + 5, 1)


def plans_of(airs):
    return [plan_of("corridor", *SHORT, *air) for air in airs]


@pytest.mark.parametrize("airs", TOGETHER.values(), ids=TOGETHER)
def test_every_run_of_several_plans_in_one_batch_is_the_run_alone(airs):
    flights = [Flight(plan, seeds) for plan, seeds in zip(plans_of(airs), cycle(SEEDS), strict=False)]
    batch = together(flights)
    flown = History(batch.world, len(batch.channels), batch.reports)
    InProcessSwarm(batch).fly(flown.extend, 20)
    arrays, agents, links = flown.arrays(), 0, 0
    seen = set()
    for air, flight in zip(airs, flights, strict=True):
        for seed in flight.seeds:
            alone = rehearse(plan_of("corridor", *SHORT, *air, f"seed={seed}")).arrays
            size, width = flight.plan.world.formation.agents, len(flight.plan.world.links)
            for name in ("position", "input", "estimate", "covariance", "psi", "known"):
                np.testing.assert_array_equal(arrays[name][:, agents : agents + size], alone[name], name)
            for name in ("verdicts", "newest"):
                np.testing.assert_array_equal(arrays[name][..., links : links + width], alone[name], name)
            agents, links = agents + size, links + width
            seen.add(alone["verdicts"].tobytes())
    assert agents == batch.world.formation.agents
    assert len(seen) == sum(len(flight.seeds) for flight in flights)  # each meets an air of its own


def test_what_comes_of_each_plan_is_what_comes_of_it_alone():
    flights = [Flight(plan, seeds) for plan, seeds in zip(plans_of(TOGETHER["availability"]), SEEDS, strict=True)]
    for flight, runs in zip(flights, fly_together(flights, 4), strict=True):
        alone = fly_all(*flight, 4)
        assert len(runs.mean_error) == len(flight.seeds)
        for name in ("seconds", "mean_error", "psi", "bounds"):
            np.testing.assert_array_equal(getattr(runs, name), getattr(alone, name), name)
        for name in ("quantities", "first"):
            assert getattr(runs, name).keys() == getattr(alone, name).keys()
            for what, values in getattr(alone, name).items():
                np.testing.assert_array_equal(getattr(runs, name)[what], values, what)


OTHERWISE = [
    *("time.dt=0.04", "time.duration=1.2", 'time.exchange="next-tick"', "sensing.sigma=0.2"),
    *("formation.scale=1.1", "formation.spread=0.3", "dynamics.disturbance=0.01", "agents.leader_gain=0.9"),
    *("agents.limit=3.0", 'agents.estimator="ral"', 'agents.law="static"', "agents.parameters.ga-rkf.sigma_w=0.4"),
    *("network.delay_ticks=1", SPLIT, "record.every=3"),
]


@pytest.mark.parametrize("otherwise", OTHERWISE)
def test_plans_that_differ_in_more_than_their_links_are_refused(otherwise):
    plan, other = (plan_of("corridor", *SHORT, "network.availability=0.5", *more) for more in ((), (otherwise,)))
    assert alike(plan, plan_of("corridor", *SHORT, "network.availability=0.6"))
    assert not alike(plan, other)
    assert not alike(other, plan)
    with pytest.raises(NotABatch, match="plans that differ in more than what each link has for itself"):
        together([Flight(plan, [1]), Flight(other, [1])])


@pytest.mark.parametrize("own", ["seed=2", 'timeline=[{verb="cut",at=0.5,links=["2->4"]}]'])
def test_draws_and_faults_are_each_runs_own(own):
    plan, other = plan_of("corridor", *SHORT), plan_of("corridor", *SHORT, own)
    assert alike(plan, other)
    assert alike(other, plan)


def test_delays_of_other_laws_are_refused():
    late = [aired(f'delay={{model="exponential",mean={mean}}}') for mean in (0.1, 0.2)]
    plan, other = plans_of(late)
    assert plan.brief.lateness == other.brief.lateness  # as long as the run: neither has a bound
    assert not alike(plan, other)


FLOWN = [
    *((("brief",), field.name) for field in fields(plan_of("corridor", *SHORT).brief)),
    *((("world",), field.name) for field in fields(plan_of("corridor", *SHORT).world) if field.name != "run_seed"),
    *((("swarm",), field.name) for field in fields(plan_of("corridor", *SHORT).swarm)),
    *(((), field.name) for field in fields(Plan) if field.name not in ("findings", "scenario", "profiles", "faults")),
]


@pytest.mark.parametrize(("of", "name"), FLOWN, ids=str)
def test_a_difference_planted_in_any_field_is_found(of, name):
    plan = plan_of("corridor", *SHORT)
    within = getattr(plan, *of) if of else plan
    changed = replace(within, **{name: object()})
    other = replace(plan, **{of[0]: changed}) if of else changed
    assert not alike(plan, other)
    assert not alike(other, plan)


def test_a_difference_planted_in_an_air_is_found():
    plan = plan_of("corridor", *SHORT, *aired('delay={model="normal",mean=0.1,jitter=0.01}'))
    (air,) = plan.profiles
    (law,) = air.delays
    changed = [
        *(
            replace(air, **{field.name: object()})
            for field in fields(air)
            if field.name not in {*BY_LINK, "own", "delays"}
        ),
        replace(air, delays=()),
        *(replace(air, delays=(one,)) for one in (replace(law, mean=0.2), replace(law, law=DelayLaw.PARETO))),
    ]
    assert len(changed) > 10
    for other in changed:
        assert not alike(plan, replace(plan, profiles=(other,)))
    assert not alike(plan, replace(plan, profiles=(air, air)))
    assert alike(plan, replace(plan, profiles=(replace(air, delays=(replace(law, rows=~law.rows),)),)))


class Agreeable:
    def __eq__(self, other):
        return True

    __hash__ = None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        *(
            (1, 1.0),
            (1, True),
            (0.0, -0.0),
            ((1, 2), [1, 2]),
            ((1, 2), (1, 2, 3)),
            ({"a": 1}, {"a": 2}),
            ({"a": 1}, {}),
        ),
        *((np.zeros(2), np.zeros((2, 1))), (np.zeros(2), np.zeros(2, dtype=np.int64)), (np.zeros(2), -np.zeros(2))),
        *((np.array([None]), np.array([None])), (Agreeable(), Agreeable()), (None, 0), ("a", b"a")),
    ],
)
def test_what_is_not_known_to_be_the_same_is_not(one, other):
    assert not same(one, other)


def test_what_is_the_same_bit_for_bit_is():
    for one in (np.nan, (1, "a", None), {"a": [1.5]}, np.array([np.nan, 1.0])):
        assert same(one, one)
    assert same(float("nan"), float("nan"))
    assert same({"a": [1.5, (2,)]}, {"a": [1.5, (2,)]})
    assert same(np.array([np.nan, 1.0]), np.array([np.nan, 1.0]))
