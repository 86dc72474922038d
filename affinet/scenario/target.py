"""The table of a scenario about a target to pursue: what moves it, and how it is found."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from affinet.scenario.profiles import Section
from affinet.scenario.units import Finite, NotNegative, Positive, Probability, Steps, refuse_unordered

_ROUNDING = 1e-9


class Waypoint(Section):
    """Where a target is at a time, in metres."""

    time: NotNegative
    position: list[Finite]


class TargetSection(Section):
    """A target to pursue: position in m, velocity in m/s.

    `intensity` is W of the noise that drives it, per axis, in m2/s^(2 order - 1), as agents know it; `true_intensity` the true
    one, where it is another. Or it takes a `path`. Detectors take one of `latencies` (s), and find it with the variance (m2) of
    that one: chosen at random for each detection, all alike or with `probabilities`; by turns, as in `schedule`; or of each
    agent its own, as in `methods`, both with numbers from 1. They find nothing in a share of `misses`, and in one of
    `false_positives` something else, about the target by the standard deviation `clutter` (m).
    """

    order: Annotated[int, Field(ge=1, le=4)] = 2
    intensity: NotNegative = 1.0
    true_intensity: NotNegative | None = None
    path: Annotated[list[Waypoint], Field(min_length=2)] | None = None
    position: list[Finite] | None = None
    velocity: list[Finite] | None = None
    latencies: Annotated[list[Positive], Field(min_length=1)]
    variances: Annotated[list[Positive], Field(min_length=1)]
    probabilities: list[Probability] | None = None
    schedule: Annotated[list[Steps], Field(min_length=1)] | None = None
    methods: list[Steps] | None = None
    misses: Probability = 0.0
    false_positives: Probability = 0.0
    clutter: NotNegative = 5.0

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
        for key in ("schedule", "methods"):
            if max(getattr(self, key) or [1]) > len(self.latencies):
                raise ValueError(f"{key} has a method {max(getattr(self, key))}, and there are {len(self.latencies)}")
        return self

    @model_validator(mode="after")
    def _moved(self) -> TargetSection:
        if self.path is None:
            return self
        if other := [key for key in ("true_intensity", "position", "velocity") if getattr(self, key) is not None]:
            raise ValueError(f"a target on a path has no {' and no '.join(other)}: give the one or the other")
        refuse_unordered("times of the path", [point.time for point in self.path])
        return self
