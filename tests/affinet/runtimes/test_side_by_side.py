"""Many runs of a plan flown as one: each of them bit for bit the run alone."""

import numpy as np
import pytest
from flying import plan_of

from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.side_by_side import NotABatch, side_by_side
from affinet.studies.batch import fly_all
from agents.algebra import kalman
from agents.estimators.rkf import RelativeKalmanFilter
from analysis.metrics import consistency, errors
from netem.medium.verdict import Verdict
from world.books.history import History

SEEDS = (1, 7, 2**63 + 5)
SHORT = ("time.dt=0.05", "time.duration=3")
AIRS = {
    "lossy": (),
    "late": ("network.delay_ticks=2", "network.coupled=false"),
    "next-tick": ('time.exchange="next-tick"', "agents.parameters.varying-velocity.relaxation=0.3"),
    "wild": (
        'network.profile="wild"',
        'network.profiles.wild={like="wifi_busy",duplicate=0.1,corrupt=[{kind="bias",p=0.1,by=0.2}]}',
    ),
    "scripted": (
        'timeline=[{verb="kill",at=0.5,agents=[5]},{verb="restart",at=1.0,agents=[5],state="warm"},'
        '{verb="partition",at=1.0,lasts=0.5,groups="leaders",in_flight="hold"},{verb="lose",at=1.2,links=["all"],loss=0.4},'
        '{verb="gust",at=2,lasts=0.3,agents=["followers"],velocity=[0.5,0]},{verb="outlier",at=0,links=["all"],p=0.1,sigma=1},'
        '{verb="degrade",at=2.0,links=["2->4"],profile="wifi_clear"},{verb="dropout",at=2.2,links=["4"],p=0.5}]',
    ),
    "rkf": ('agents.estimator="rkf"', "dynamics.disturbance=0.01"),
    "range-bearing": ('agents.estimator="imm"', "sensing={sigma_range=0.05, sigma_bearing=0.02}"),
}


# Gains that hold at this tick; the numbers of a swarm that diverges would be no numbers in the end, and agree.
GENTLE = ("agents.parameters.static.alpha=1", "agents.leader_gain=0.02")
PUSHED = 'dynamics={covariance=[[4e-4, 1e-4], [1e-4, 2e-4]], kernel={length=2.0, positions="%s"}, persistence=%s}'
RIGID = {
    "kernel": (PUSHED % ("nominal", 0.6), *GENTLE),
    "kernel-of-true-places": (
        PUSHED % ("true", 0.6),
        'agents.estimator="edge-kf"',
        "network.availability=0.7",
        *GENTLE,
    ),
}
FLIGHTS = [
    *(("corridor", air) for air in AIRS.values()),
    ("ravine", ("dynamics.disturbance=0.01",)),
    *(("rigid", air) for air in RIGID.values()),
]


def thin(impairment):
    """The overrides that give all links this impairment."""
    return f"network.profiles.thin={{{impairment}}}", 'network.profile="thin"'


@pytest.mark.parametrize(("name", "air"), FLIGHTS, ids=[*AIRS, "double-integrators", *RIGID])
def test_every_run_of_a_batch_is_the_run_alone(name, air):
    plan = plan_of(name, *SHORT, *air)
    batch, size, width = side_by_side(plan, SEEDS), plan.world.formation.agents, len(plan.world.links)
    together = History(batch.world, len(batch.channels), batch.reports)
    InProcessSwarm(batch).fly(together.extend, 20)
    flown = together.arrays()
    for place, seed in enumerate(SEEDS):
        alone = rehearse(plan_of(name, *SHORT, *air, f"seed={seed}")).arrays
        agents, links = slice(size * place, size * (place + 1)), slice(width * place, width * (place + 1))
        for array in ("position", "input", "estimate", "covariance", "psi", "known"):
            np.testing.assert_array_equal(flown[array][:, agents], alone[array], array)
        for array in ("verdicts", "newest"):
            np.testing.assert_array_equal(flown[array][..., links], alone[array], array)
        np.testing.assert_array_equal(flown["measured"][:, links], alone["measured"])
        assert np.isfinite(alone["position"]).all()


def test_the_runs_of_a_study_are_those_runs():
    plan = plan_of("corridor", *SHORT)
    formation, links = plan.world.formation, plan.world.links
    runs = fly_all(plan, range(3, 60), every=4)
    alone = rehearse(plan_of("corridor", *SHORT, "seed=57"))
    np.testing.assert_array_equal(runs.quantities["error"][54], alone.error[::4])
    np.testing.assert_array_equal(runs.psi[54], alone.arrays["psi"][::4])
    arrays = {name: array[:60:4] for name, array in alone.arrays.items()}
    position, known = arrays["position"], arrays["known"]
    true = position[..., :, None, :] - position[..., links.neighbours, :]
    expected = {
        "procrustes": errors.procrustes_error(position, formation.nominal, np.ones((15, 7), dtype=bool)),
        "estimation_error": errors.estimation_error(arrays["estimate"], true, known),
        "covariance_trace": errors.covariance_trace(arrays["covariance"], 2),
        "nees": consistency.of_errors(arrays["estimate"], true, arrays["covariance"], known).mean,
    }
    for name, values in expected.items():
        assert len(np.unique(values)) == 15
        np.testing.assert_allclose(runs.quantities[name][54], values, rtol=1e-12, err_msg=name)
        assert runs.quantities[name].shape == (57, 15)
    assert runs.mean_error[54] == pytest.approx(alone.error.mean(), rel=1e-12)
    np.testing.assert_allclose(runs.seconds, np.arange(0.0, 3.0, 0.2))


@pytest.mark.parametrize("every", [1, 4, 7])
def test_the_longest_input_is_that_of_any_agent_in_any_tick_since_the_moment_kept_before(every):
    runs = fly_all(plan_of("corridor", *SHORT), (3, 57), every=every)
    for row, seed in enumerate((3, 57)):
        length = np.linalg.norm(rehearse(plan_of("corridor", *SHORT, f"seed={seed}")).arrays["input"], axis=-1)
        longest = length.max(axis=-1)
        kept = range(0, 60, every)
        expected = [longest[max(0, tick - every + 1) : tick + 1].max() for tick in kept]
        np.testing.assert_array_equal(runs.quantities["peak"][row], expected)
        # Those of the moments kept alone would not do.
        assert (runs.quantities["peak"][row] == longest[::every]).all() == (every == 1)


@pytest.mark.parametrize("every", [1, 4])
def test_roughness_is_that_of_every_step_since_the_moment_kept_before(every):
    runs = fly_all(plan_of("corridor", *SHORT), (3, 57), every=every)
    for row, seed in enumerate((3, 57)):
        position = rehearse(plan_of("corridor", *SHORT, f"seed={seed}")).arrays["position"]
        steps = np.diff(position, axis=0, prepend=position[[0]])  # at rest before
        changes = np.diff(steps, axis=0, prepend=steps[[0]])
        squares = (changes**2).sum(axis=-1).mean(axis=-1)
        expected = [np.sqrt(squares[max(0, tick - every + 1) : tick + 1].mean()) for tick in range(0, 60, every)]
        np.testing.assert_allclose(runs.quantities["roughness"][row], expected, rtol=1e-12)


def test_the_procrustes_error_falls_by_the_rates_told():
    runs = fly_all(plan_of("rigid", "time.dt=0.01", "time.duration=1", 'agents.estimator="mle"'), (3, 57), every=10)
    error, fall = runs.quantities["procrustes"], runs.quantities["fall"]
    assert np.isnan(fall[:, 0]).all()
    np.testing.assert_allclose(error[:, -1] / error[:, 0], np.exp(-0.1 * fall[:, 1:].sum(axis=1)))


def test_of_the_first_run_of_a_study_everything_that_is_reported_is_kept():
    short = (*SHORT, "time.duration=0.5")
    runs = fly_all(plan_of("corridor", *short), range(3, 60), every=4)  # more than are flown at once
    assert runs.first.keys() == {"position", "input", "theta"}
    alone = rehearse(plan_of("corridor", *short, "seed=3")).arrays
    np.testing.assert_array_equal(runs.first["position"], alone["position"][:10:4])
    localized = ("localization", "time.duration=0.1")
    runs = fly_all(plan_of(*localized), (5, 6), every=3)
    assert runs.first.keys() == {"position", "input", "place"}
    for name, kept in runs.first.items():
        alone = rehearse(plan_of(*localized, "seed=5")).arrays[name]
        np.testing.assert_array_equal(kept, alone[:10:3], name)


def test_normalised_errors_and_innovations_of_a_study_are_those_of_the_filters_themselves():
    lossy = ("corridor", *SHORT, 'agents.estimator="rkf"', "network.availability=0.5")
    plan = plan_of(*lossy)
    links, sensor, dt = plan.world.links, plan.world.sensor, plan.world.dt
    seeds = (4, 9)
    runs = fly_all(plan, seeds, every=3)
    F, Q = kalman.motion("constant-acceleration", dt, RelativeKalmanFilter().sigma_w)
    for row, seed in enumerate(seeds):
        arrays = rehearse(plan_of(*lossy, f"seed={seed}")).arrays
        heard = arrays["verdicts"][:, 0] == Verdict.DELIVERED
        assert 0.4 < heard.mean() < 0.6
        # The filters once more, link by link, with innovations as they come.
        means, covariances = kalman.unknown((len(links),), 2, (10.0, 2.0, 1.0))
        known = np.zeros(len(links), dtype=bool)
        for tick in range(60):
            means, covariances = kalman.predict(means, covariances, F, Q)
            innovations = arrays["measured"][tick] - means[:, :2]
            S = covariances[:, :2, :2] + sensor.covariance
            nis = [nu @ np.linalg.inv(each) @ nu for nu, each in zip(innovations, S, strict=True)]
            means, covariances, _ = kalman.correct(
                means, covariances, arrays["measured"][tick], sensor.covariance, heard[tick]
            )
            known |= heard[tick]
            position = arrays["position"][tick]
            off = means[:, :2] - (position[links.dst - 1] - position[links.src - 1])
            nees = [e @ np.linalg.inv(each[:2, :2]) @ e for e, each in zip(off, covariances, strict=True)]
            if tick % 3 == 0:
                assert runs.quantities["nees"][row, tick // 3] == pytest.approx(
                    np.mean(np.array(nees)[known]), rel=1e-9
                )
                assert runs.quantities["nis"][row, tick // 3] == pytest.approx(
                    np.mean(np.array(nis)[heard[tick]]), rel=1e-9
                )


def test_where_nothing_is_filtered_no_innovation_is_known():
    runs = fly_all(plan_of("corridor", "time.dt=0.05", "time.duration=0.5", 'agents.estimator="none"'), (1, 2), 1)
    assert np.isnan(runs.quantities["nis"]).all()
    assert np.isfinite(runs.quantities["nees"]).all()


@pytest.mark.parametrize(
    ("over", "says"),
    [
        (("network.zones=[{centre=[0,0],radius=1}]",), "a jammed zone"),
        (thin("rate={rate=1e5,queue=4000}"), "a rate limit"),
        (thin('loss=[{model="list",messages=[3]}]'), "a list of messages"),
        (thin('loss=[{model="disk",range=20}]'), "loss by distance"),
        (thin('loss=[{model="round-robin"}]'), "a schedule"),
        (('timeline=[{verb="cut",links=["all"],when={tracking_error_below=0.1}}]',), "a condition"),
    ],
)
def test_what_differs_between_runs_is_refused(over, says):
    with pytest.raises(NotABatch, match=says):
        side_by_side(plan_of("corridor", *SHORT, *over), SEEDS)


def test_a_trace_is_refused(tmp_path):
    plan = plan_of("corridor", *SHORT)
    rows = [f"0,{src},{dst},0.5" for src, dst in plan.world.links.index]
    trace = tmp_path / "trace.csv"
    trace.write_text("\n".join(["time,src,dst,availability", *rows]))
    with pytest.raises(NotABatch, match="a trace"):
        side_by_side(plan_of("corridor", *SHORT, *thin(f'loss=[{{model="trace",file="{trace}"}}]')), SEEDS)
