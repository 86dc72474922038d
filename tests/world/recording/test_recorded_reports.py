"""What a recording shows of a target and of places, and of what agents know of them."""

from functools import cache

import numpy as np
import pytest
from flying import plan_of
from pursuits import COARSE, NAME
from recorded import chunks_of, column
from scripted import timeline

from affinet.runtimes.run import fly
from analysis.metrics import localization
from world.books.history import ARRAYS, load
from world.books.localized import FirstMeasurements
from world.recording.target import _over_agents


@cache
def recorded(out):
    return chunks_of(out / "run.rrd")


@pytest.fixture(scope="module")
def pursuit_on_file(tmp_path_factory):
    out = tmp_path_factory.mktemp("pursuit") / "run"
    dead = timeline({"verb": "kill", "at": 0.25, "agents": [5]})
    fly(plan_of(NAME, *COARSE, "time.duration=0.4", dead), "inprocess", out, lambda *_: None)
    return out


def test_a_recording_of_a_pursuit_shows_the_target_and_what_agents_know_of_it(pursuit_on_file):
    chunks, arrays = recorded(pursuit_on_file), load(pursuit_on_file / ARRAYS)
    kept = {name: array[:40:5] for name, array in arrays.items()}
    nominal = plan_of(NAME, *COARSE).world.formation.nominal
    points = {
        path: np.array(column(chunks, f"/swarm/{path}/at", "Points3D:positions"))
        for path in ("target", "found", "agreed")
    }
    target = (kept["target"] - nominal)[:, :1]
    np.testing.assert_allclose(points["target"][..., :2], target, atol=1e-5)
    np.testing.assert_allclose(points["found"][..., :2], kept["found"], atol=1e-5)
    np.testing.assert_allclose(points["agreed"][..., :2], kept["reference"][:, :, 0], atol=1e-5)
    told = np.array(column(chunks, "/metrics/target", "Scalars:scalars"))
    # Agent 5 dies, and those left count.
    assert np.isnan(kept["found"]).any(axis=(1, 2)).tolist() == [False] * 5 + [True] * 3
    expected = [
        np.sqrt(np.nanmean(((each - target) ** 2).sum(axis=-1), axis=-1))
        for each in (kept["found"], kept["reference"][:, :, 0])
    ]
    off = np.stack(expected, axis=-1)
    np.testing.assert_array_equal(np.isnan(told), off == 0.0)
    np.testing.assert_allclose(10.0 ** told[off > 0.0], off[off > 0.0], rtol=1e-6)
    strips = column(chunks, "/swarm/agreed/spread", "LineStrips3D:strips")
    assert [len(moment) for moment in strips] == [10] * 8
    away = np.linalg.norm(np.array(strips[4])[..., :2] - kept["reference"][4, :, None, 0], axis=-1)
    np.testing.assert_allclose(away, 2 * np.sqrt(kept["variance"][4])[:, None].repeat(25, 1), rtol=1e-4)


def test_a_recording_of_another_flight_shows_no_pursuit_and_no_places(tmp_path):
    mute = plan_of("localization", "time.duration=0.1", 'agents.estimator="none"')
    fly(mute, "inprocess", tmp_path / "run", lambda *_: None)
    paths = {str(chunk.entity_path) for chunk in recorded(tmp_path / "run")}
    assert not paths & {
        "/swarm/agreed/at",
        "/metrics/target",
        "/swarm/place",
        "/metrics/localization",
        "/swarm/perceived",
    }


def test_a_recording_of_localization_shows_places_the_best_places_and_ellipses(tmp_path):
    blind = timeline({"verb": "cut", "at": 0, "until": 1.0, "links": ["all"]})
    out = tmp_path / "run"
    fly(plan_of("localization", "time.duration=1.5", blind), "inprocess", out, lambda *_: None)
    chunks, arrays = recorded(out), load(out / ARRAYS)
    place, best = (
        np.array(column(chunks, f"/swarm/{path}", "Points3D:positions"), dtype=float) for path in ("place", "optimal")
    )
    assert place.shape == best.shape == (30, 10, 3)
    off = np.array(column(chunks, "/metrics/localization", "Scalars:scalars"), dtype=float)[:, 0]
    # Before anything was measured, there is no best answer.
    assert np.isnan(off[:5]).all()
    assert np.isfinite(off[20:]).all()
    here = np.sqrt(((place - best) ** 2).sum(axis=-1).mean(axis=-1))
    seen = here > 1e-5  # below, positions of single floats tell nothing
    assert seen[20:23].all()
    np.testing.assert_allclose(off[seen], np.log10(here[seen]), atol=1e-2)
    assert off[20] > off[-1]
    # They are drawn where agents are, and not at the origin of the common frame.
    moved = place[..., :2] - arrays["place"][:150:5]
    np.testing.assert_allclose(moved[20:], np.broadcast_to(moved[20:, :1], moved[20:].shape), atol=1e-5)
    away = np.linalg.norm(place[-1, :, :2] - arrays["position"][-1], axis=-1)
    assert away.max() < 3.0 < np.linalg.norm(arrays["place"][-1] - arrays["position"][-1], axis=-1).min()
    strips = column(chunks, "/swarm/measured", "LineStrips3D:strips")
    assert [len(moment) for moment in strips] == [28]
    assert {len(line) for line in strips[0]} == {25}


def test_a_recording_of_localization_goes_on_when_one_dies(tmp_path):
    dead = timeline({"verb": "kill", "at": 0.2, "agents": [4]})
    plan, out = plan_of("localization", "time.duration=0.4", dead), tmp_path / "run"
    fly(plan, "inprocess", out, lambda *_: None)
    chunks, arrays = recorded(out), load(out / ARRAYS)
    told = np.array(column(chunks, "/metrics/localization", "Scalars:scalars"), dtype=float)[:, 0]
    kept = arrays["place"][:40:5]
    assert np.isnan(kept).any(axis=(1, 2)).tolist() == [False] * 4 + [True] * 4
    known = FirstMeasurements.of(plan.world, plan.timeline, arrays["measured"], arrays["verdicts"][:, 0])
    np.testing.assert_allclose(told, np.log10(localization.distance(kept, known.edges())), rtol=1e-6)
    assert np.isfinite(told).all()
    place, best = (
        np.array(column(chunks, f"/swarm/{path}", "Points3D:positions"), dtype=float) for path in ("place", "optimal")
    )
    assert np.isfinite(best).all()
    assert np.isfinite(np.delete(place, 3, axis=1)).all()
    off = np.delete(place - best, 3, axis=1)[4:]
    np.testing.assert_allclose(np.sqrt((off**2).sum(axis=-1).mean(axis=-1)), 10.0 ** told[4:], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("estimator", ["ral", "conral", "ga-rkf"])
def test_a_recording_of_maps_shows_the_formation_as_each_agent_perceives_it(estimator, tmp_path):
    """Paper 000, Fig. 7."""
    deaf = timeline({"verb": "cut", "at": 0, "links": ["leaders->7", "followers->7"]})
    plan, out = (
        plan_of("corridor", f"agents.estimator={estimator}", "time.duration=0.4", "network={}", deaf),
        tmp_path / "run",
    )
    fly(plan, "inprocess", out, lambda *_: None)
    arrays, nominal = load(out / ARRAYS), plan.world.formation.nominal
    shown = np.array(column(recorded(out), "/swarm/perceived", "Points3D:positions"), dtype=float)[..., :2]
    moments = len(shown)
    step = len(arrays["error"]) // moments
    theta, position = arrays["theta"][::step], arrays["position"][:-1][::step]
    expected = position[:, :, None] + np.einsum("tiab,ijb->tija", theta, nominal[None] - nominal[:, None])
    np.testing.assert_allclose(shown.reshape(expected.shape), expected, atol=1e-4)
    # Who hears nobody has no map; the others have one, and by it itself is where it is.
    assert np.isnan(theta[:, 6]).all()
    assert np.isfinite(theta[:, :6]).all()
    np.testing.assert_allclose(shown.reshape(expected.shape)[:, 2, 2], position[:, 2], atol=1e-4)


def test_a_distance_over_agents_is_that_of_those_who_say_anything():
    off = np.array([[[3.0, 4.0], [0.0, 0.0]], [[3.0, 4.0], [np.nan] * 2], [[np.nan] * 2] * 2])
    np.testing.assert_allclose(_over_agents(off), [np.sqrt(12.5), 5.0, np.nan])
