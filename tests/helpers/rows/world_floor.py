"""`netem` and `world`."""

from dataclasses import replace

import numpy as np
from flying import plan_of

from netem.core import draws
from netem.core.draws import Purpose
from netem.faults import lie
from netem.faults.fault import Fault, Verb
from netem.impairments import chain, corrupt, delay, reach
from netem.impairments.loss import gilbert_elliott
from netem.impairments.schedule import Schedule
from netem.impairments.trace import Trace
from rows.case import covariance, leaves, of, real, share, truth, whole
from world.books import edges
from world.formation import manoeuvre
from world.physics import bodies, disturbance, noise, sensors
from world.recording import curves, stage

LINKS, MANY = 6, 500
FEW = np.ones(LINKS, dtype=bool)
NUMBERS = np.arange(1, LINKS + 1)
CHAINS = {
    states: chain.ChainLayer.of(
        0, [chain.all_together([gilbert_elliott(0.3, 0.4)] * alike)] * LINKS, ~FEW, sensing=True, comms=True
    )
    for states, alike in ((2, 1), (8, 3))
}
SCHEDULE = Schedule(np.full(LINKS, 7), NUMBERS, np.full(LINKS, 3), True, True)
TRACE = Trace(np.array([0, 5, 9]), np.random.default_rng(9).random((3, LINKS)), True, True)
LIAR = Fault(Verb.LIE, 0, 9, agents=(1,), matrix=((0.3, 0.7), (-1.1, 0.9)))
KERNELS = {shape: disturbance.Kernel(shape, 2.0, "true") for shape in ("exponential", "squared-exponential")}
PUSH = disturbance.Disturbance(np.array([[0.02, 0.01], [0.01, 0.03]]), KERNELS["exponential"], 0.6)
AHEAD = disturbance.Kernel("exponential", 2.0, "nominal")
NOMINAL = np.random.default_rng(7).normal(size=(9, 2))
TIMES = [0.0, 0.4, 1.0]
THETA, OFFSET = (np.random.default_rng(8).normal(size=(3, *size)) for size in ((2, 2), (2,)))


def _law(law):
    return delay.MessageDelay(law, FEW, 0.1, 0.05, np.array([0.01, 0.02, 0.09]), 0.0, False)


def _plan():
    return plan_of("hexa", "time.duration=1")


def _carried_off(body, position, motion, flown, push):
    rows = [
        np.reshape(one, (-1, *shape)) for one, shape in ((position, (2,)), (motion, motion.shape[-2:]), (flown, (2,)))
    ]
    here, moving, commanded = rows
    moved = body.moved(bodies.Motion(here, moving, here[:, :1]), commanded, push.reshape(-1, 2), 0.013)
    return tuple(one.reshape(*position.shape[:-1], *one.shape[1:]) for one in moved)


def _of_swarms(present, position, verdicts, estimate, spread, known, nis):
    return edges.of_swarms(
        _plan().world,
        present=present,
        position=position,
        verdicts=verdicts,
        estimate=estimate,
        covariance=spread,
        known=known,
        nis=nis,
    )


def _drawn(tick, src):
    return draws.uniform(3, Purpose.LOSS, tick=tick, src=src, lanes=9)


def _philox(*words):
    unsigned = [np.asarray(word).astype(np.uint64) for word in words]
    return draws.philox(tuple(unsigned[:4]), tuple(unsigned[4:]))


def _at_least_one(function, axes=0):
    """Of a function that wants a row axis: alone, a row is a batch of one."""

    def call(first, *others):
        if np.ndim(first) > axes:
            return function(first, *others)
        found = function(*(np.asarray(one)[None] for one in (first, *others)))
        return [leaf[0] for leaf in leaves(found)]

    return call


def _moments(manoeuvre):
    return of(_at_least_one(manoeuvre), share(), rows=100)


def _corrupted_fields(numbers, kind, bias, draw):
    return corrupt.corrupted_fields({"a": numbers[:, :4], "b": numbers[:, 4:]}, kind, bias, draw)


SLOTS = (10, *_plan().world.links.slots.shape[1:])
DIRECTED = len(_plan().world.links)

CASES = {
    **{
        f"netem.impairments.delay.MessageDelay.quantile ({law})": of(_law(law).quantile, share(), rows=MANY)
        for law in delay.DelayLaw
    },
    "netem.impairments.delay.ticks": of(lambda s: delay.ticks(s, 0.01), share(), rows=MANY),
    "netem.impairments.delay.correlated": of(
        lambda before, fresh: delay.correlated(before, fresh, 0.7), real(), real(), rows=MANY
    ),
    "netem.impairments.reach.Reach.limit (ramp)": of(
        reach.Reach(reach.ReachLaw.RAMP, FEW, 3.0, 9.0, 2.0, 4.0, 5, True, True).limit, share(LINKS), real(LINKS)
    ),
    "netem.impairments.reach.Reach.limit (log-distance)": of(
        reach.Reach(reach.ReachLaw.LOG_DISTANCE, FEW, 3.0, 9.0, 2.7, 4.0, 5, True, True).limit,
        share(LINKS),
        real(LINKS),
    ),
    "netem.impairments.reach.squared_distances": of(
        lambda position: reach.squared_distances(NUMBERS - 1, NUMBERS, position), real(LINKS + 1, 3)
    ),
    "netem.core.draws.philox": of(_philox, *[whole(2**32)] * 6),
    "netem.core.draws.uniform": of(_drawn, whole(999), whole(99)),
    "netem.impairments.chain.ChainLayer.begin": of(CHAINS[2].begin, share(LINKS)),
    **{
        f"netem.impairments.chain.ChainLayer.walk ({states} states)": of(
            layer.walk, whole(2, LINKS), share(9, LINKS, axis=1), out=(1, 0)
        )
        for states, layer in CHAINS.items()
    },
    "netem.impairments.chain.ChainLayer.lost": of(CHAINS[2].lost, whole(2, LINKS), share(LINKS)),
    "netem.impairments.chain.ChainLayer.adds": of(CHAINS[2].adds, whole(2, LINKS)),
    "netem.impairments.corrupt.marks": of(lambda draw: corrupt.marks(np.full((LINKS, 4), 0.2), draw), share(LINKS)),
    "netem.impairments.corrupt.corrupted": of(_at_least_one(corrupt.corrupted, 1), real(9), whole(5), real(), share(2)),
    "netem.impairments.corrupt.corrupted_fields": of(
        _at_least_one(_corrupted_fields, 1), real(9), whole(5), real(), share(2)
    ),
    "netem.faults.lie.told": of(lambda theta: lie.told({"theta": theta}, LIAR), real(2, 2)),
    "netem.impairments.schedule.Schedule.closed": of(_at_least_one(SCHEDULE.closed), whole(99)),
    "netem.impairments.trace.Trace.lost": of(_at_least_one(TRACE.lost), whole(20), share(2, LINKS)),
    "world.physics.disturbance.Kernel.correlation (exponential)": of(KERNELS["exponential"].correlation, real(9, 2)),
    "world.physics.disturbance.Kernel.correlation (squared-exponential)": of(
        KERNELS["squared-exponential"].correlation, real(9, 2)
    ),
    "world.physics.disturbance.Disturbance.next": of(PUSH.next, real(9, 2), real(9, 2), real(9, 2)),
    "world.physics.disturbance.Disturbance.drawn": of(
        lambda white: replace(PUSH, kernel=AHEAD).drawn(white, PUSH.root(NOMINAL)), real(9, 2)
    ),
    "world.physics.bodies.carried": of(lambda *motion: bodies.carried(motion, 0.013), *[real(9, 2)] * 4),
    "world.physics.bodies.Integrators.moved": of(
        lambda position, motion, flown, push: _carried_off(bodies.Integrators(3), position, motion, flown, push),
        *(real(2), real(2, 2), real(2), real(2)),
    ),
    "world.physics.bodies.Unicycle.moved": of(
        lambda position, motion, flown, push: _carried_off(bodies.Unicycle(0.3), position, motion, flown, push),
        *(real(2), real(1, 2), real(2), real(2)),
    ),
    "world.books.edges.of_swarms": of(
        _of_swarms,
        *(truth(10), real(10, 2), whole(3, DIRECTED), real(*SLOTS, 2), real(*SLOTS, 3), truth(*SLOTS), real(*SLOTS)),
    ),
    "world.formation.manoeuvre.corridor": _moments(lambda seconds: manoeuvre.corridor(100.0 * seconds)),
    "world.formation.manoeuvre.ravine": _moments(lambda seconds: manoeuvre.ravine(60.0 * seconds)),
    "world.formation.manoeuvre.hover": _moments(lambda seconds: manoeuvre.hover(seconds, 3)),
    "world.formation.manoeuvre.course": _moments(lambda seconds: manoeuvre.course(seconds, TIMES, OFFSET, 4)),
    "world.formation.manoeuvre.keyframes": _moments(lambda seconds: manoeuvre.keyframes(seconds, TIMES, THETA, OFFSET)),
    "world.physics.noise.normal": of(
        lambda tick, src: noise.normal(3, Purpose.SENSOR_NOISE, tick=tick, src=src, axes=3),
        whole(999),
        whole(99),
        rows=MANY,
    ),
    "world.physics.sensors.noise": of(lambda white: sensors.noise(white, PUSH.covariance), real(9, 2)),
    "world.physics.sensors.relative": of(lambda position: sensors.relative(position, _plan().world.links), real(10, 2)),
    "world.recording.curves.decades": of(curves.decades, real(9, 3)),
    "world.recording.stage.spatial": of(stage.spatial, real(9, 2)),
    "world.recording.stage.ellipses": of(
        lambda centre, spread: stage.ellipses(centre, spread, 3.0), real(9, 3), covariance(9, 3, 3)
    ),
}
