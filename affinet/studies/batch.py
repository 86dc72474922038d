"""Many runs flown side by side: what comes of each, tick by tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from affinet.planning.plan import Plan
from affinet.runtimes.inprocess import BatchTick, InProcessSwarm
from affinet.runtimes.side_by_side import Flight, together
from affinet.verdicts.metrics import METRICS, seen
from analysis.metrics import errors
from analysis.metrics.indicator import Bounds, bounds
from analysis.metrics.localization import centroid, distance, place_error, place_nees, ringing
from analysis.models.arrays import Array, Mask
from analysis.models.graph import adjacency
from analysis.models.information import position, reported
from analysis.models.jacobi import EdgeInformation, weights
from analysis.models.reports import NIS
from netem.core import channels
from netem.faults import lie
from netem.faults.timeline import Timeline
from netem.medium.verdict import Verdict, VerdictCodes
from world.books.history import Moment
from world.books.localized import FirstMeasurements

REPORT = "report:"  # and the name of a report: a quantity

# What a tick costs however many fly is then a third of it.
AT_ONCE = 200


@dataclass(frozen=True)
class Runs:
    """What came of many runs.

    Parameters
    ----------
    seconds
        Of the ticks kept, shape (T,).
    mean_error
        Tracking error (15), its mean over all ticks of each run, shape (R,), in square metres.
    psi
        Convergence indicators (16) in those ticks, shape (R, T, N).
    bounds
        Slopes and offsets (18) of the graph of each of those ticks, shape (R, T, N) each; NaN where a map is not told, or
        sensors read no coordinates.
    quantities
        By name, in those ticks, shape (R, T): `error`, the tracking error, infinite where a run has left the numbers; all of
        `affinet.verdicts.metrics`, NaN where no edge counts; and `report:name`, how long what the estimator reports is, in the
        mean over the agents awake.

        `localization`, `drift`, `ringing`: distance from the optimal places, and of the weighted centroid from where it began,
        in metres, and which share of the steps since the moment before went back; NaN where nobody localizes, the second also
        while anybody is silent. `place_error`, `place_nees`: how far the places are from the true ones, in metres, and the same
        squared, normalised by what all measurements make of it.

        `found`, `agreed`, `ideal`, `apart`, `disagreed`, `behind`, `effort`, of agents that pursue a target: how far the target
        is from where each finds it by itself, from where the agents agree that it is, and from where all they know together
        puts it (8); how far agreed and ideal are apart; how far each agent's agreed one is from their mean; how far agents are
        from the places that they steer for; how hard they steer. Root mean squares over the agents, in metres, and metres per
        second or per second squared. `target_nees`: `agreed`, squared, normalised by the variance that agents report of it, in
        the mean over the agents; as many as there are axes where they know how unsure they are. NaN where nobody pursues.

        `peak`: the longest input of any agent since the moment before, in metres per second or per second squared.

        `roughness`: how much a step of the agents differs from the one before, root mean square over agents and ticks since
        the moment before, in metres; before the first tick they rest.

        `fall`: by which rate the Procrustes error has fallen since the moment before, per second; NaN in the first.
    first
        Of the first run in those ticks: what its estimator reports, by name, shapes (T, N, ...), the agents' `position` and
        `input`, and the `target` where there is one, (T, D), in metres.
    """

    seconds: Array
    mean_error: Array
    psi: Array
    bounds: Bounds
    quantities: Mapping[str, Array]
    first: Mapping[str, Array]

    @property
    def corrected(self) -> Array:
        """Mean indicators over the runs, corrected by their mean bounds, (psi - b) / c, shape (T, N), in square metres."""
        defined = np.isfinite(self.bounds.slope)
        excess = np.where(defined, self.psi - self.bounds.offset, 0.0).sum(axis=0)
        slope = np.where(defined, self.bounds.slope, 0.0).sum(axis=0)
        return np.where(slope > 0.0, excess / np.where(slope > 0.0, slope, 1.0), np.nan)

    def together(self, other: Runs) -> Runs:
        """These runs and others of the same ticks."""
        return Runs(
            seconds=self.seconds,
            mean_error=np.concatenate([self.mean_error, other.mean_error]),
            psi=np.concatenate([self.psi, other.psi]),
            bounds=Bounds(*(np.concatenate(both) for both in zip(self.bounds, other.bounds, strict=True))),
            quantities={
                name: np.concatenate([values, other.quantities[name]]) for name, values in self.quantities.items()
            },
            first=self.first,
        )

    def part(self, rows: slice, place: int) -> Runs:
        """These of them, where `first` begins with several: those whose first is in this place."""
        return Runs(
            seconds=self.seconds,
            mean_error=self.mean_error[rows],
            psi=self.psi[rows],
            bounds=Bounds(*(each[rows] for each in self.bounds)),
            quantities={name: values[rows] for name, values in self.quantities.items()},
            first={name: values[place] for name, values in self.first.items()},
        )


def fly_all(plan: Plan, seeds: Sequence[int], every: int, tell: Callable[[float], None] = lambda _: None) -> Runs:
    """The runs of a plan with each of these seeds.

    Parameters
    ----------
    plan, seeds
        What to fly, and with which draws.
    every
        Ticks from one that is kept to the next.
    tell
        Told which share of it is done, tick by tick.

    Raises
    ------
    NotABatch
        When the plan cannot be flown side by side.
    """
    firsts = range(0, len(seeds), AT_ONCE)
    parts = [
        fly_together([Flight(plan, seeds[first : first + AT_ONCE])], every, _of_all(tell, number, len(firsts)))
        for number, first in enumerate(firsts)
    ]
    return reduce(Runs.together, (runs for (runs,) in parts))


def _of_all(tell: Callable[[float], None], number: int, parts: int) -> Callable[[float], None]:
    return lambda share: tell((number + share) / parts)


def fly_together(flights: Sequence[Flight], every: int, tell: Callable[[float], None] = lambda _: None) -> list[Runs]:
    """The runs of several plans, all at once: those of each, bit for bit as it flies alone.

    Parameters
    ----------
    flights
        What to fly, and with which draws; a seed may occur in several.
    every, tell
        As of `fly_all`.

    Raises
    ------
    NotABatch
        When the plans are not alike, or one of them cannot be flown side by side.
    """
    ends = [*accumulate((len(flight.seeds) for flight in flights), initial=0)]
    flown = _fly(flights, ends[:-1], every, tell)
    return [flown.part(slice(*rows), place) for place, rows in enumerate(pairwise(ends))]


def _fly(flights: Sequence[Flight], firsts: Sequence[int], every: int, tell: Callable[[float], None]) -> Runs:
    """All runs; `first` of the result begins with the flights, whose first runs these are."""
    batch, plan, runs = together(flights), flights[0].plan, sum(len(flight.seeds) for flight in flights)
    size = plan.world.formation.agents
    swarm = InProcessSwarm(batch)
    kept: list[dict[str, Array]] = []
    psi: list[Array] = []
    limits: list[Bounds] = []
    first: list[dict[str, Array]] = []
    flown = _Flown(runs)
    places = _Places(plan, runs)

    def of_runs(array: Any) -> Any:
        return array.reshape(runs, size, *array.shape[1:])

    def of_links(array: Any) -> Any:
        return np.moveaxis(array.reshape(len(array), runs, -1), 0, 1)

    with np.errstate(over="ignore", invalid="ignore"):  # of runs that diverge
        for instant in swarm.ticks():
            present = of_runs(~swarm.timeline.at(instant.tick).absent)
            goal = batch.world.goal(instant.tick, instant.scene)
            flown.step(of_runs(instant.scene.position), of_runs(goal), of_runs(instant.input), present)
            places.measure(instant, swarm.timeline)
            if instant.tick % every == 0:
                moment = swarm.moment(instant)
                looked_at = _looked_at(batch, present, moment)
                awake = of_runs(~swarm.timeline.at(instant.tick).idle)
                pursued = _pursued(batch, awake, moment, of_runs)
                kept.append({**flown.since(), **looked_at, **pursued, **_reported(moment, awake, of_runs)})
                psi.append(of_runs(moment.psi))
                limits.append(_bounds(plan, present, of_links(moment.entry.verdicts)))
                first.append(_shown(plan, moment, firsts, of_runs))
                places.keep(moment)
            tell((instant.tick + 1) / plan.world.ticks)
        error = np.stack(flown.errors, axis=1)
        mean_error = error.mean(axis=1)
        seconds = np.arange(0, error.shape[1], every, dtype=np.float64) * plan.world.dt
        over_moments = {name: np.stack([one[name] for one in kept], axis=1) for name in kept[0]}
    return Runs(
        seconds=seconds,
        mean_error=mean_error,
        psi=np.stack(psi, axis=1),
        bounds=Bounds(*(np.stack(each, axis=1) for each in zip(*limits, strict=True))),
        quantities={
            "error": error[:, ::every],
            **over_moments,
            "fall": errors.rate_of_fall(seconds, over_moments["procrustes"]),
            **places.found(len(kept)),
        },
        first={name: np.stack([one[name] for one in first], axis=1) for name in first[0]},
    )


def _bounds(plan: Plan, present: Mask, verdicts: VerdictCodes) -> Bounds:
    """Those of the indicators in a tick in which links fared so, (R, C, L), and these agents were present, (R, N)."""
    world = plan.world
    if lie.CHANNEL not in plan.channels or world.sensor.reads != "coordinates":
        return Bounds(*np.full((2, *present.shape), np.nan))
    links, delivered = world.links, verdicts == Verdict.DELIVERED
    seen, heard = (
        adjacency(delivered[:, channel], links.src, links.dst, links.agents)
        for channel in (0, plan.channels.index(lie.CHANNEL))
    )
    return bounds(world.formation.nominal, heard, world.sensor.common, seen, present)


class _Flown:
    """How many runs fly, tick by tick."""

    def __init__(self, runs: int) -> None:
        self.errors: list[Array] = []
        self._path: tuple[Array, ...] = ()
        self._ticks, self._change, self._peak = 0, np.zeros(runs), np.zeros(runs)

    def step(self, position: Array, target: Array, steered: Array, present: Mask) -> None:
        """Take in a tick: where agents are and should be, and what they fly, shape (R, N, D); who takes part, (R, N)."""
        self._path = (*(self._path[-2:] or (position, position)), position)
        tick = errors.tick_flown(self._path, target, steered, present)
        self.errors.append(tick.error)
        self._ticks, self._change = self._ticks + 1, self._change + tick.change
        self._peak = np.maximum(self._peak, tick.longest)

    def since(self) -> dict[str, Array]:
        """The longest input, and how rough the paths are, since this was asked last, shape (R,)."""
        said = {"peak": self._peak, "roughness": np.sqrt(self._change / self._ticks)}
        self._ticks, self._change, self._peak = 0, np.zeros_like(self._change), np.zeros_like(self._peak)
        return said


class _Places:
    """Where the agents of many runs believe they are, and what all their measurements say."""

    def __init__(self, plan: Plan, runs: int) -> None:
        self._wanted = channels.PLACE in plan.reports
        self._runs = runs
        self._first = FirstMeasurements(plan.world.links, plan.world.sensor, (runs,), plan.world.formation.dimension)
        self._kept: list[Array] = []
        self._true: list[Array] = []
        self._recent: list[Array] = []
        self._since = 0
        self._rang: list[Array] = []

    def measure(self, instant: BatchTick, timeline: Timeline) -> None:
        """Take in the measurements of a tick, under the timeline of all runs."""
        if self._wanted:
            measured, verdicts = self._of_runs(instant.measured), self._of_runs(instant.acted.relayed.verdicts.kind[0])
            self._first.tick(timeline, instant.tick, measured, verdicts)
            self._recent.append(self._of_runs(instant.acted.action.estimate.reports[channels.PLACE]))
            self._since += 1

    def keep(self, moment: Moment) -> None:
        """Keep what the agents believe in a tick."""
        if self._wanted:
            self._kept.append(self._of_runs(moment.reports[channels.PLACE]))
            self._true.append(self._of_runs(moment.position))
            self._rang.append(ringing(np.stack(self._recent, axis=1))[:, -self._since :].mean(axis=1))
            self._recent, self._since = self._recent[-2:], 0  # a step, and the step before it

    def found(self, moments: int) -> dict[str, Array]:
        """How far off they were, how far their centroid has gone, how much they rang, and how far from the truth, (R, T)."""
        if not self._wanted:
            nothing = np.full((self._runs, moments), np.nan)
            return dict.fromkeys(("localization", "drift", "ringing", "place_error", "place_nees"), nothing)
        place, true, edges = np.stack(self._kept, axis=1), np.stack(self._true, axis=1), self._first.edges()
        edges = EdgeInformation(edges.information[:, None], edges.pull[:, None])
        centre = centroid(place, weights(edges))
        return {
            "localization": distance(place, edges),
            "drift": np.linalg.norm(centre - centre[:, :1], axis=-1),
            "ringing": np.stack(self._rang, axis=1),
            "place_error": place_error(place, true),
            "place_nees": place_nees(place, true, edges),
        }

    def _of_runs(self, array: Any) -> Any:
        return array.reshape(self._runs, -1, *array.shape[1:])


def _looked_at(plan: Plan, present: Mask, moment: Moment) -> dict[str, Array]:
    """What is kept of a tick of all runs of a plan."""
    of_agents = {name: getattr(moment, name) for name in ("position", "estimate", "covariance", "known")}
    of_agents[NIS] = moment.reports.get(NIS)
    looked_at = seen(plan.world, present.reshape(-1), moment.entry.verdicts[0], of_agents)
    return {name: metric.of(looked_at) for name, metric in METRICS.items()}


def _reported(moment: Moment, awake: Mask, of_runs: Callable[[Any], Any]) -> dict[str, Array]:
    """How long what each agent reports is, in the mean over those awake (R, N), shape (R,); NaN where nobody is."""
    number = np.where(awake.any(axis=1), awake.sum(axis=1), np.nan)
    means = {}
    for name, told in moment.reports.items():
        if name == NIS:  # a metric
            continue
        each = of_runs(told)
        length = each if each.ndim == 2 else np.sqrt((each * each).sum(axis=tuple(range(2, each.ndim))))
        means[f"{REPORT}{name}"] = np.where(awake, length, 0.0).sum(axis=1) / number
    return means


def _shown(plan: Plan, moment: Moment, firsts: Sequence[int], of_runs: Callable[[Any], Any]) -> dict[str, Array]:
    """Of these runs, the first of each flight, shapes (F, N, ...)."""
    said = {"position": moment.position, "input": moment.input, **moment.reports}
    shown = {name: of_runs(each)[firsts] for name, each in said.items() if name != NIS}
    if plan.world.pursuit is None:
        return shown
    return {**shown, "target": of_runs(moment.target)[firsts, 0] - plan.world.formation.nominal[0]}


def _pursued(plan: Plan, awake: Mask, moment: Moment, of_runs: Callable[[Any], Any]) -> dict[str, Array]:
    """How well a target is found and followed by those awake (R, N) in a tick of all runs, shape (R,)."""
    names = ("found", "agreed", "ideal", "apart", "disagreed", "behind", "effort")
    pursuit, nominal = plan.world.pursuit, plan.world.formation.nominal
    if pursuit is None or not reported(moment.reports):
        return dict.fromkeys((*names, "target_nees"), np.full(plan.world.swarms, np.nan))
    said = moment.reports
    target, flown = of_runs(moment.target - nominal), of_runs(moment.position - nominal)
    agreed, found, information = map(of_runs, (said["reference"][:, 0], said["found"], said["information"][:, 0]))
    number = np.where(awake.any(axis=1), awake.sum(axis=1), np.nan)
    mean = np.where(awake[..., None], information, 0.0).sum(axis=1) / number[:, None]
    ideal = position(mean, target.shape[-1], pursuit.target.order)[:, None]
    together = np.where(awake[..., None], agreed, 0.0).sum(axis=1, keepdims=True) / number[:, None, None]
    steered = (flown - agreed, of_runs(moment.input))
    off = (found - target, agreed - target, ideal - target, agreed - ideal, agreed - together, *steered)
    normalised = errors.root_mean_square((agreed - target) / np.sqrt(of_runs(said["variance"]))[..., None], awake)
    squares = {name: errors.root_mean_square(each, awake) for name, each in zip(names, off, strict=True)}
    return {**squares, "target_nees": normalised * normalised}
