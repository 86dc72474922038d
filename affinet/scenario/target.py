"""The table of a scenario about a target to pursue: what moves it, and how it is found."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from affinet.scenario.keys import key
from affinet.scenario.section import Section
from affinet.scenario.units import Finite, NotNegative, Positive, Probability, Steps, refuse_unordered

_ROUNDING = 1e-9


class Waypoint(Section):
    """Where a target is at a time, in metres."""

    time: NotNegative = key(..., "when it is there", "s")
    position: list[Finite] = key(..., "where", "m")


class TargetSection(Section):
    """A target to pursue: position in m, velocity in m/s.

    `intensity` is W of the noise that drives it, per axis, in m2/s^(2 order - 1), as agents know it; `true_intensity` the true
    one, where it is another. Or it takes a `path`. Detectors take one of `latencies` (s), and find it with the variance (m2) of
    that one: chosen at random for each detection, all alike or with `probabilities`; by turns, as in `schedule`; or of each
    agent its own, as in `methods`, both with numbers from 1. They find nothing in a share of `misses`, and in one of
    `false_positives` something else, about the target by the standard deviation `clutter` (m).
    """

    order: Annotated[int, Field(ge=1, le=4)] = key(
        2, "how often the noise that drives the target is integrated to a position"
    )
    intensity: NotNegative = key(1.0, "W of that noise, per axis, as agents know it", "m2/s^(2 order - 1)")
    true_intensity: NotNegative | None = key(
        None, "the W that truly drives it, where it is another", "m2/s^(2 order - 1)"
    )
    path: Annotated[list[Waypoint], Field(min_length=2)] | None = key(
        None, "or no noise, but a way through points; monotone cubics between, at rest before and after"
    )
    position: list[Finite] | None = key(None, "where it begins, by default the origin", "m")
    velocity: list[Finite] | None = key(None, "how fast it begins, by default at rest", "m/s")
    latencies: Annotated[list[Positive], Field(min_length=1)] = key(
        ..., "of the methods of detection: how long each takes, a whole number of ticks", "s"
    )
    variances: Annotated[list[Positive], Field(min_length=1)] = key(
        ..., "of the methods: the variance per axis of what each finds", "m2"
    )
    probabilities: list[Probability] | None = key(
        None, "of the methods, where one is chosen at random; by default all alike"
    )
    schedule: Annotated[list[Steps], Field(min_length=1)] | None = key(
        None, "or the methods by turns, with numbers from 1, like [1, 2, 2]"
    )
    methods: list[Steps] | None = key(None, "or a method for each agent, with numbers from 1")
    misses: Probability = key(0.0, "share of all detections that find nothing")
    false_positives: Probability = key(0.0, "share of all detections that find something else, missed or not")
    clutter: NotNegative = key(5.0, "how far about the target that lies, standard deviation per axis", "m")

    @model_validator(mode="after")
    def _paired(self) -> TargetSection:
        if len(self.latencies) != len(self.variances):
            raise ValueError("give a variance for each latency")
        return self

    @model_validator(mode="after")
    def _chosen(self) -> TargetSection:
        keys = ("probabilities", "schedule", "methods")
        if len(given := [key for key in keys if getattr(self, key) is not None]) > 1:
            raise ValueError(f"give one of {' and '.join(given)}: each says which method a detection uses")
        if self.probabilities is not None:
            if len(self.probabilities) != len(self.latencies):
                raise ValueError("give a probability for each latency")
            if abs(sum(self.probabilities) - 1.0) > _ROUNDING:
                raise ValueError(f"probabilities come to {sum(self.probabilities):g}, not to 1")
        for name in ("schedule", "methods"):
            if max(getattr(self, name) or [1]) > len(self.latencies):
                raise ValueError(f"{name} has a method {max(getattr(self, name))}, and there are {len(self.latencies)}")
        return self

    @model_validator(mode="after")
    def _moved(self) -> TargetSection:
        if self.path is None:
            return self
        if other := [key for key in ("true_intensity", "position", "velocity") if getattr(self, key) is not None]:
            raise ValueError(f"a target on a path has no {' and no '.join(other)}: give the one or the other")
        refuse_unordered("times of the path", [point.time for point in self.path])
        return self
