"""What a recording holds."""

from dataclasses import replace

import numpy as np
import pytest
from flying import plan_of
from recorded import column
from rerun.chunk import RrdReader
from scipy.stats import chi2

from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from netem.medium.verdict import Verdict
from world.books.history import ARRAYS, UNTOLD, load

FAULTS = (
    'timeline=[{verb="cut",at=0.5,until=1.0,links=["4-6"]},{verb="kill",at=1.2,agents=[7]},'
    '{verb="restart",at=1.6,agents=[7]},{verb="partition",at=1.7,until=1.9,groups=[[1,2,3],[4,5,6,7]]}]'
)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    out = tmp_path_factory.mktemp("recording") / "run"
    fly(plan_of("corridor", "time.duration=2", FAULTS), "inprocess", out, lambda *_: None)
    return out


@pytest.fixture(scope="module")
def chunks(flown):
    return RrdReader(str(flown / "run.rrd")).stream().to_chunks()


def test_it_holds_the_swarm_the_graphs_the_target_and_the_metrics(chunks):
    assert {
        "/swarm/agents",
        "/swarm/trail",
        "/swarm/target",
        "/swarm/graph/nominal",
        "/swarm/graph/functional",
        "/swarm/believed",
        "/swarm/input",
        "/swarm/perceived",
        "/swarm/scale",
        "/swarm/walls",
        "/metrics/tracking_error",
        "/metrics/off",
        "/metrics/procrustes",
        "/metrics/psi",
        "/metrics/consistency",
        "/metrics/infeasible",
        "/messages/delivered",
        "/graph/connectivity",
        "/ages/matrix",
        "/spacetime/messages",
        "/processes/7",
        "/events",
        "/settings",
    } <= {str(chunk.entity_path) for chunk in chunks}


def test_it_is_on_simulated_time(chunks):
    seconds = [value.total_seconds() for value in column(chunks, "/metrics/tracking_error", "sim_time")]
    assert seconds == pytest.approx(np.arange(0.0, 2.0, 0.05).tolist())


def test_the_tracking_error_is_that_of_the_run(chunks, flown):
    recorded = [value[0] for value in column(chunks, "/metrics/tracking_error", "Scalars:scalars")]
    np.testing.assert_allclose(recorded, np.log10(load(flown / ARRAYS)["error"][::5]), rtol=1e-12)


def normalised(plan, arrays, tick):
    """NEES, NIS and how many edges are estimated, edge by edge."""
    links, position = plan.world.links, arrays["position"][tick]
    errors, innovations = [], []
    present = plan.timeline.present([tick])[0]
    for i, j in np.argwhere(arrays["known"][tick]):
        link = links.slots[i, j]
        if not (present[i] and present[links.src[link] - 1]):  # who is dead counts in no error
            continue
        z, P = arrays["estimate"][tick, i, j], arrays["covariance"][tick, i, j][[[0, 1], [1, 2]]]
        error = z - (position[i] - position[links.src[link] - 1])
        errors.append(error @ np.linalg.solve(P, error))
        if arrays["verdicts"][tick, 0, link] == Verdict.DELIVERED:
            innovations.append(arrays["nis"][tick, i, j])
    return np.mean(errors), np.mean(innovations), len(errors)


def test_consistency_is_that_of_the_edges_with_a_band_as_wide_as_they_are_many(chunks, flown):
    recorded = np.array(column(chunks, "/metrics/consistency", "Scalars:scalars"))
    assert recorded.shape == (40, 4)
    plan, arrays = plan_of("corridor", "time.duration=2", FAULTS), load(flown / ARRAYS)
    arrays = {name: arrays[name] for name in ("position", "estimate", "known", "covariance", "nis", "verdicts")}
    numbers = []
    for moment in range(40):
        error, innovation, number = normalised(plan, arrays, 5 * moment)
        numbers.append(number)
        low, high = chi2.interval(0.95, 2 * number)
        np.testing.assert_allclose(recorded[moment], [error, innovation, low / number, high / number], rtol=1e-6)
    assert len(set(numbers)) > 1  # somebody was dead for a while


def test_consistency_knows_ranges_and_bearings_from_coordinates(out):
    over = ("time.duration=0.2", 'agents.estimator="rkf"', "sensing={sigma_range=0.05, sigma_bearing=0.02}")
    plan = plan_of("corridor", *over, "network.coupled=false")  # what is sensed is not what is heard
    fly(plan, "inprocess", out, lambda *_: None)
    recorded = np.array(
        column(RrdReader(str(out / "run.rrd")).stream().to_chunks(), "/metrics/consistency", "Scalars:scalars")
    )
    arrays = load(out / ARRAYS)
    for moment in range(4):
        np.testing.assert_allclose(recorded[moment, :2], normalised(plan, arrays, 5 * moment)[:2], rtol=1e-6)


def test_where_nothing_is_estimated_there_is_no_consistency_but_a_band(out):
    deaf = ('timeline=[{verb="cut",at=0,links=["all"]}]', 'agents.estimator="rkf"', "time.duration=0.1")
    fly(plan_of("corridor", *deaf), "inprocess", out, lambda *_: None)
    chunks = RrdReader(str(out / "run.rrd")).stream().to_chunks()
    recorded = np.array(column(chunks, "/metrics/consistency", "Scalars:scalars"))
    assert np.isnan(recorded[:, :2]).all()
    assert (recorded[:, 2:] == recorded[0, 2:]).all()
    np.testing.assert_allclose(recorded[0, 2:], chi2.interval(0.95, 2), rtol=1e-9)


@pytest.mark.parametrize(
    ("estimator", "sensing"), [("imm", "{sigma=0.1}"), ("rkf", "{sigma_range=0.05, sigma_bearing=0.02}")]
)
def test_a_swarm_that_diverges_in_space_is_recorded_to_the_end(estimator, sensing, out):
    plan = plan_of("ravine", f'agents.estimator="{estimator}"', f"sensing={sensing}", "time.duration=0.2")
    far = replace(plan, world=replace(plan.world, spread=1e308))
    done = fly(far, "inprocess", out, lambda *_: None)
    assert done.verdict == "fail"
    assert "diverged" in done.reasons[0]


def test_messages_are_counted_over_all_ticks(chunks, flown):
    verdicts = load(flown / ARRAYS)["verdicts"]
    counts = {verdict: int((verdicts == verdict).sum()) for verdict in Verdict if verdict != Verdict.SILENT}
    told = {verdict: 5 * np.sum(column(chunks, f"/messages/{verdict.label}", "Scalars:scalars")) for verdict in counts}
    assert told == pytest.approx(counts)
    assert {str(chunk.entity_path) for chunk in chunks} & {f"/messages/{verdict.label}" for verdict in Verdict} == {
        f"/messages/{verdict.label}" for verdict, number in counts.items() if number
    }


def test_faults_are_told_as_text(chunks):
    told = [value[0] for value in column(chunks, "/events", "TextLog:text")]
    assert told == [
        "cut 6->4, 4->6",
        "heal: cut 6->4, 4->6",
        "kill 7",
        "restart 7",
        "partition 1,2,3 | 4,5,6,7",
        "heal: partition 1,2,3 | 4,5,6,7",
    ]


def test_colours_tell_leaders_from_followers_from_the_dead(chunks):
    colours = column(chunks, "/swarm/agents", "Points3D:colors")
    alive, dead = colours[0], colours[28]  # at 1.4 s agent 7 is dead
    assert alive[0] == alive[1] == alive[2] != alive[3]
    assert alive[3] == alive[6] != dead[6]


def test_colours_tell_what_became_of_an_edge(chunks):
    colours = column(chunks, "/swarm/graph/functional", "LineStrips3D:colors")
    assert len({colour for moment in colours for colour in moment}) >= 5  # delivered, lost, cut, dead, partition


def test_agents_whose_neighbours_determine_no_map_are_told_tick_by_tick():
    plan = plan_of("corridor", "time.duration=1", "network.availability=0.4", "record.enabled=false")
    evidence, links = rehearse(plan), plan.world.links
    seen = (evidence.arrays["verdicts"][:, 0] == Verdict.DELIVERED)[:, links.slots] & links.present
    rank = np.linalg.matrix_rank(np.where(seen[..., None], plan.brief.relative, 0.0))
    assert set(rank.ravel().tolist()) == {0, 1, 2}
    np.testing.assert_array_equal(evidence.arrays["feasible"], rank == 2)


def test_an_estimator_without_maps_and_a_dead_agent_tell_none():
    dead = 'timeline=[{verb="kill",at=0.1,agents=[5]}]'
    mute, killed = (
        rehearse(plan_of("corridor", "time.duration=0.2", "record.enabled=false", over)).arrays["feasible"]
        for over in ('agents.estimator="rkf"', dead)
    )
    assert (mute == UNTOLD).all()
    assert (killed[:, 4] == UNTOLD).tolist() == [False] * 10 + [True] * 10
    assert (np.delete(killed, 4, axis=1) != UNTOLD).all()


def test_positions_far_from_the_origin_keep_their_millimetres(tmp_path):
    # Single floats tell half a metre apart at 4,649,776 m.
    frames = ",".join(f"{{time={x},theta=[[1,0],[0,1]],offset=[{500_000 + x},4649776]}}" for x in (0, 1))
    home = f"manoeuvre={{keyframes=[{frames}]}}"
    fly(plan_of("corridor", "time.dt=0.05", "time.duration=0.5", home), "inprocess", tmp_path / "utm", lambda *_: None)
    far = RrdReader(str(tmp_path / "utm" / "run.rrd")).stream().to_chunks()
    recorded = np.array(column(far, "/swarm/agents", "Points3D:positions"))
    position = load(tmp_path / "utm" / ARRAYS)["position"][:-1:5]
    assert np.abs(recorded[..., :2] + [500_000.0, 4_649_000.0] - position).max() < 1e-3
    (said,) = (chunk.to_record_batch() for chunk in far if str(chunk.entity_path) == "/origin")
    assert said.column("TextDocument:text").to_pylist() == [["positions are relative to (500000, 4649000) m"]]
