"""How a recording is laid out when it is opened: a scene, and beside it what there is to see of the task and of the network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import rerun.blueprint as rrb

from world.physics.world import World
from world.recording.links import MOST_IN_A_MATRIX, SHAPE, SWEEP
from world.recording.stage import TIMELINE

_LEGEND = 0.3  # of the length of a run: kept free of curves
_TRAIL_S = 8.0
HIDDEN = ("believed", "range")  # until they are asked for, in the panel on the left


@dataclass(frozen=True)
class Shown:
    """What there is to see.

    Parameters
    ----------
    localizes, pursues, maps, edges
        Whether agents say where they believe they are, find a target, fit maps, or estimate edges.
    in_real_time
        Whether processes have a time to keep.
    """

    localizes: bool
    pursues: bool
    maps: bool
    edges: bool
    in_real_time: bool


def blueprint(world: World, shown: Shown, reach: float, every: int) -> rrb.Blueprint:
    """The layout of a recording of this world, of one tick in so many; `reach` is that of its formation, in metres."""
    curves = Curves(world.ticks * world.dt)
    agents = world.formation.agents
    air = [
        _messages(agents, SWEEP * every * world.dt),
        *([_matrix(agents)] if agents <= MOST_IN_A_MATRIX else []),
    ]
    seen = scene("swarm", "swarm", reach, flat=world.formation.dimension == 2)
    panels = rrb.Vertical(
        rrb.Tabs(*_of_the_task(curves, shown)),
        rrb.Tabs(*_of_the_network(curves, shown)),
        rrb.Tabs(
            rrb.StateTimelineView(origin="processes", name="processes"),
            rrb.TextLogView(origin="events", name="events"),
            rrb.TextDocumentView(origin="settings", name="settings"),
        ),
        row_shares=[4, 4, 3],
    )
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(seen, rrb.Tabs(*air), row_shares=[3, 1]), panels, column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )


class Curves:
    """Makes views of curves, with a margin in which their legends cover none.

    Parameters
    ----------
    duration_s
        How long they are.
    """

    def __init__(self, duration_s: float) -> None:
        ends = rrb.TimeRangeBoundary.absolute(seconds=duration_s * (1.0 + _LEGEND))
        begins = rrb.TimeRangeBoundary.absolute(seconds=0.0)
        self._axis = rrb.TimeAxis(view_range=rrb.TimeRange(start=begins, end=ends))

    def view(
        self, origin: str, name: str, *, legend: bool = True, contents: Sequence[str] = ("$origin/**",)
    ) -> rrb.View:
        """A view of the curves below an entity, or of some."""
        corner = rrb.PlotLegend(rrb.Corner2D.RightTop, visible=legend)
        return rrb.TimeSeriesView(
            origin=origin, contents=list(contents), name=name, axis_x=self._axis, plot_legend=corner
        )


def _of_the_task(curves: Curves, shown: Shown) -> list[rrb.View]:
    views = []
    if shown.localizes:
        views.append(curves.view("metrics/localization", "off the best places (log10 m)", legend=False))
    else:
        if shown.pursues:
            views.append(curves.view("metrics/target", "error of the target (log10 m)"))
        views += [
            curves.view("metrics/tracking_error", "tracking error (log10 m²)", legend=False),
            curves.view("metrics/off", "off target, by agent (log10 m)"),
            curves.view("metrics/procrustes", "off its shape (log10 m)", legend=False),
        ]
    if shown.maps:
        views.append(curves.view("metrics/psi", "psi, by agent (log10)"))
        views.append(curves.view("metrics/infeasible", "agents that can fit no map"))
    if shown.edges:
        views.append(curves.view("metrics/consistency", "filter consistency"))
    return views


def _of_the_network(curves: Curves, shown: Shown) -> list[rrb.View]:
    views = [
        curves.view("messages", "messages per tick, by verdict"),
        curves.view("graph/connectivity", "connectivity"),
        curves.view("graph/joint_connectivity", "connectivity in a window"),
        curves.view("graph/age", "age of information (s)"),
        curves.view("graph", "rigidity", contents=("graph/feasible", "graph/stress_dimension")),
    ]
    return [*views, curves.view("timing", "how late processes are (ms)")] if shown.in_real_time else views


def scene(origin: str, name: str, reach: float, *, flat: bool) -> rrb.View:
    """A view of a swarm whose formation is so large, in metres, in a plane or not."""
    eye = rrb.EyeControls3D(
        position=(0.0, -0.01 * reach, 2.0 * reach) if flat else (-1.4 * reach, -2.0 * reach, 1.1 * reach),
        look_target=(0.0, 0.0, 0.0),
        eye_up=(0.0, 1.0, 0.0) if flat else (0.0, 0.0, 1.0),
        tracking_entity=f"{origin}/agents",
    )
    hidden = {f"{origin}/{layer}": rrb.EntityBehavior(visible=False) for layer in HIDDEN}
    return rrb.Spatial3DView(
        origin=origin,
        name=name,
        line_grid=False,
        eye_controls=eye,
        overrides={f"{origin}/trail": rrb.VisibleTimeRanges([_lately(_TRAIL_S)]), **hidden},
    )


def _messages(agents: int, sweep_s: float) -> rrb.View:
    return rrb.Spatial2DView(
        origin="spacetime",
        name="messages in space and time",
        visual_bounds=rrb.VisualBounds2D(x_range=[-1.0, SHAPE * agents + 1.0], y_range=[0.0, agents + 1.0]),
        time_ranges=[_lately(sweep_s)],
    )


def _lately(seconds: float) -> rrb.VisibleTimeRange:
    until = rrb.TimeRangeBoundary.cursor_relative()
    return rrb.VisibleTimeRange(TIMELINE, start=rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds), end=until)


def _matrix(agents: int) -> rrb.View:
    bounds = rrb.VisualBounds2D(x_range=[-1.5, agents + 0.5], y_range=[-1.5, agents + 0.5])
    return rrb.Spatial2DView(origin="ages", name="age of what is heard, up to 1 s", visual_bounds=bounds)
