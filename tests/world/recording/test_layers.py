"""What the layers of a recording show, against the arrays of the run."""

import numpy as np
import pytest
from flying import plan_of
from recorded import chunks_of, column

from affinet.runtimes.run import fly
from netem.core.parts import parts
from netem.medium.verdict import Verdict
from world.books.history import ARRAYS, load
from world.recording import palette
from world.recording.curves import _spread, decades
from world.recording.links import _by_age
from world.recording.swarm import _round_length

FAULTS = (
    'timeline=[{verb="pause",at=0.3,until=0.5,agents=[5]},{verb="kill",at=0.8,agents=[7]},'
    '{verb="restart",at=1.2,agents=[7]},{verb="cut",at=0.2,until=1.4,links=["6->4"]}]'
)
LATE = "network={availability=0.7, delay_ticks=3, zones=[{centre=[0.0, 0.0], radius=1.5, share=0.5}]}"


def recorded(out, *overrides, name="corridor"):
    fly(plan_of(name, *overrides), "inprocess", out, lambda *_: None)
    (file,) = parts(out / "run.rrd")
    return chunks_of(file), load(out / ARRAYS)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("layers") / "run", "time.duration=1.6", FAULTS, LATE)


def _of(chunks, path):
    return [chunk for chunk in chunks if str(chunk.entity_path) == path]


def test_ticks_stand_beside_the_time(flown):
    chunks, _ = flown
    assert column(chunks, "/metrics/tracking_error", "tick") == list(range(0, 160, 5))
    assert {tuple(chunk.timeline_names) for chunk in chunks if not chunk.is_static} == {("sim_time", "tick")}


def test_the_life_of_a_process_is_told_as_it_changes(flown):
    chunks, _ = flown
    for agent, ticks, said in (
        (1, [0], ["flies"]),
        (5, [0, 30, 50], ["flies", "paused", "flies"]),
        (7, [0, 80, 120], ["flies", "dead", "flies"]),
    ):
        assert column(chunks, f"/processes/{agent}", "tick") == ticks
        assert [state for (state,) in column(chunks, f"/processes/{agent}", "StateChange:state")] == said


def test_each_message_of_a_recorded_moment_that_arrives_or_is_dropped_is_a_line_of_its_colour(flown):
    chunks, arrays = flown
    strips = column(chunks, "/spacetime/messages", "LineStrips2D:strips")
    colours = column(chunks, "/spacetime/messages", "LineStrips2D:colors")
    verdicts, newest = arrays["verdicts"][::5, -1], arrays["newest"][::5, -1]
    assert {int((newest >= 0).any()), int((newest < 0).any())} == {1}  # some arrive, and some do not
    for moment, (lines, shown) in enumerate(zip(strips, colours, strict=True)):
        arrived = newest[moment] >= 0
        dropped = ~arrived & (verdicts[moment] >= Verdict.DEAD)
        assert len(lines) == (arrived | dropped).sum()
        assert shown.count(palette.OF_VERDICT[Verdict.DELAYED]) == arrived.sum()
        assert shown.count(palette.OF_VERDICT[Verdict.CUT]) == (dropped & (verdicts[moment] == Verdict.CUT)).sum()
        rows = {abs(end[1] - begin[1]) % 1.0 for begin, end in lines}
        assert rows <= {0.0, 0.5}  # what is dropped ends half-way


def test_ages_are_an_image_with_a_row_for_who_hears(flown):
    chunks, arrays = flown
    plan = plan_of("corridor", FAULTS, LATE)
    images = [
        np.array(pixels, dtype=np.uint8).reshape(7, 7, 3)
        for (pixels,) in column(chunks, "/ages/matrix", "Image:buffer")
    ]
    links, newest = plan.world.links, arrays["newest"][:, -1]
    tick = 100
    latest = np.maximum.accumulate(newest, axis=0)[tick]
    age = np.where(latest < 0, np.nan, (tick - latest) * plan.world.dt)
    expected = np.zeros((7, 7, 3), dtype=np.uint8)
    for link, (src, dst) in enumerate(zip(links.src, links.dst, strict=True)):
        expected[dst - 1, src - 1] = _by_age(age[link])
    np.testing.assert_array_equal(images[tick // 5], expected)
    assert expected[3, 5, 0] > expected[3, 4, 0]  # 4 has not heard 6 for long: the older the redder


def test_an_ellipse_is_where_an_agent_believes_a_neighbour_is_two_deviations_wide(flown):
    chunks, arrays = flown
    centres = column(chunks, "/swarm/believed", "Ellipsoids3D:centers")
    sizes = column(chunks, "/swarm/believed", "Ellipsoids3D:half_sizes")
    turned = column(chunks, "/swarm/believed", "Ellipsoids3D:quaternions")
    moment, tick = 20, 100
    known = arrays["known"][tick]
    assert len(centres[moment]) == known.sum() > 0
    believed = arrays["position"][tick][:, None] - arrays["estimate"][tick]
    np.testing.assert_allclose(np.array(centres[moment])[:, :2], believed[known], atol=1e-5)
    for packed, half, (x, y, z, w) in zip(
        arrays["covariance"][tick][known], sizes[moment], turned[moment], strict=True
    ):
        first = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z)])
        second = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z)])
        shape = (half[0] ** 2 * np.outer(first, first) + half[1] ** 2 * np.outer(second, second)) / 4.0
        np.testing.assert_allclose(shape, packed[[[0, 1], [1, 2]]], rtol=1e-4, atol=1e-9)


def test_an_arrow_is_where_an_input_alone_leads_in_half_a_second(flown, tmp_path):
    chunks, arrays = flown
    vectors = np.array(column(chunks, "/swarm/input", "Arrows3D:vectors"))[..., :2]
    np.testing.assert_allclose(vectors, 0.5 * arrays["input"][::5], rtol=1e-5, atol=1e-6)
    double = ('agents.law="double-varying-velocity"', 'dynamics.model="double-integrator"', "time.duration=0.2")
    chunks, arrays = recorded(tmp_path / "double", *double, "agents.parameters={}")
    vectors = np.array(column(chunks, "/swarm/input", "Arrows3D:vectors"))[..., :2]
    np.testing.assert_allclose(vectors, 0.125 * arrays["input"][::5], rtol=1e-5, atol=1e-6)


def test_walls_jammed_zones_and_settings_are_there(flown):
    chunks, _ = flown
    assert len(column(chunks, "/swarm/walls", "LineStrips3D:strips", static=True)[0]) == 3
    assert column(chunks, "/swarm/jammed", "Ellipsoids3D:half_sizes", static=True) == [[[1.5, 1.5, 0.0]]]
    assert column(chunks, "/swarm/jammed", "Ellipsoids3D:labels", static=True) == [["jammed 50%"]]
    ((settings,),) = column(chunks, "/settings", "TextDocument:text", static=True)
    assert "availability = 0.7" in settings
    assert not _of(chunks, "/swarm/range")


def test_how_far_agents_hear_is_a_circle_about_each(tmp_path):
    near = 'network={profile="near", profiles={near={loss=[{model="disk", range=3.5}]}}}'
    chunks, _ = recorded(tmp_path / "run", "time.duration=0.2", near)
    assert column(chunks, "/swarm/range", "Ellipsoids3D:half_sizes", static=True) == [[[3.5, 3.5, 0.0]]]
    assert [len(centres) for centres in column(chunks, "/swarm/range", "Ellipsoids3D:centers")] == [7] * 4


def test_walls_of_ones_own_take_the_place_of_the_presets(tmp_path):
    own = "manoeuvre.walls=[[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]]"
    chunks, _ = recorded(tmp_path / "run", "time.duration=0.1", own)
    (walls,) = column(chunks, "/swarm/walls", "LineStrips3D:strips", static=True)
    assert walls == [[[1.0, 2.0, 0.0], [3.0, 4.0, 0.0], [5.0, 6.0, 0.0]]]


def test_the_curves_of_many_agents_are_their_spread():
    values = np.array([[1.0, 2.0, np.nan, 4.0, 3.0], [np.nan] * 5])
    np.testing.assert_allclose(_spread(values), [[1.0, 1.3, 2.5, 3.7, 4.0], [np.nan] * 5])


def test_decades_are_decimal_logarithms_of_what_has_one():
    np.testing.assert_allclose(
        decades(np.array([100.0, 1.0, 0.0, -1.0, np.nan])), [2.0, 0.0, *[np.nan] * 3], atol=1e-15
    )


@pytest.mark.parametrize(
    ("longest", "length"), [(1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (4.9, 2.0), (7.0, 5.0), (0.06, 0.05), (1234.0, 1000.0)]
)
def test_the_scale_is_a_round_length(longest, length):
    assert _round_length(longest) == pytest.approx(length)


def test_agents_of_a_small_swarm_have_colours_of_their_own():
    assert len(set(palette.of_agents(palette.MOST_APART))) == palette.MOST_APART
    assert len(palette.of_agents(100)) == 100
    assert set(palette.OF_VERDICT) == set(Verdict)
