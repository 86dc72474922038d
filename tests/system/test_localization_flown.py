"""Localization as it is flown: to the optimum, whatever is lost, late, cut or restarted."""

import numpy as np
import pytest
from flying import plan_of
from localized_runs import FOUR, NAME, ROW, flown, known
from measured_graphs import LINE_OF_SIGHT, Measurement, edges_of, least_squares, middle, own_weights, weighed
from scripted import timeline

from affinet.planning.plan import PlanError
from affinet.studies.batch import fly_all
from analysis.metrics import localization
from analysis.metrics.localization import centroid, optimal, ringing
from analysis.models import jacobi
from analysis.models.jacobi import weights
from netem.medium.verdict import Verdict


def by_hand(run):
    """The edges of what was measured first, searched for tick by tick and link by link."""
    links, sensor, made = run.plan.world.links, run.plan.world.sensor, []
    for row, (src, dst) in enumerate(zip(links.src.tolist(), links.dst.tolist(), strict=True)):
        arrived = np.flatnonzero(run.arrays["verdicts"][:, 0, row] == Verdict.DELIVERED)
        if len(arrived):
            y = run.arrays["measured"][arrived[0], row]
            made.append((dst - 1, src - 1, y))
    return links.agents, weighed(made, sensor)


def centre_of(run):
    return centroid(run.arrays["place"], weights(known(run)))


def test_without_losses_agents_come_to_the_optimum_and_their_centroid_stays():
    run = flown("time.duration=2")
    agents, made = by_hand(run)
    best = least_squares(agents, made, 4)
    own = own_weights(agents, made)
    np.testing.assert_allclose(run.arrays["place"][-1], best - middle(best, own), atol=1e-9)
    np.testing.assert_allclose(run.arrays["place"][-1], optimal(known(run)), atol=1e-9)
    assert np.abs(centre_of(run)).max() < 1e-12
    # That is not where they are: measurements are noisy.
    true = run.position[-1] - middle(run.position[-1], own)
    assert 0.05 < np.abs(best - middle(best, own) - true).max() < 3.0


def test_the_rate_is_the_one_that_is_told_before_the_flight():
    run = flown("time.duration=2")
    (told,) = (finding.says for finding in run.plan.findings if finding.check == "localization")
    off = localization.distance(run.arrays["place"], known(run))
    rate = jacobi.rates(known(run), 0.49, 0).centroid
    assert off[90] / off[60] == pytest.approx(rate**30, rel=0.05)
    # It is told from measurements without noise.
    assert float(told.split()[1]) == pytest.approx(rate, abs=0.03)


def test_the_check_tells_rates_and_the_fastest_steps_of_measurements_without_noise():
    nodes = np.array([[0, 0], [3, 1], [1, 4], [4, 5]], dtype=float)
    made = []
    for i, j in ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3)):
        for one, other in ((i, j), (j, i)):
            y = nodes[one] - nodes[other]
            made.append(Measurement(one, other, y, LINE_OF_SIGHT[2].spread(y)))
    edges = edges_of(4, made)
    for anchor in ("false", "true"):
        plan = plan_of(NAME, *FOUR, f"agents.parameters.jor={{h=0.3,anchor={anchor}}}")
        (told,) = (finding for finding in plan.findings if finding.check == "localization")
        rates = jacobi.rates(edges, 0.3, 2)  # agent 3 leads
        chosen = rates.anchor if anchor == "true" else rates.centroid
        assert abs(rates.anchor - jacobi.rates(edges, 0.3, 0).anchor) > 1e-3
        assert told.level == "ok"
        assert told.says == (
            f"rate {chosen:.4f} a tick with h 0.3 (weighted centroid {rates.centroid:.4f}, agent 3 as the anchor "
            f"{rates.anchor:.4f}); h {jacobi.step(edges, 'smooth'):.3f} is the fastest without ringing, "
            f"{jacobi.step(edges, 'fast'):.3f} of all"
        )


@pytest.mark.parametrize("leaders", [[], [1, 2]], ids=str)
def test_an_anchor_is_exactly_one_agent_that_leads(leaders):
    chosen = f"formation.leaders={leaders}"
    with pytest.raises(PlanError) as told:
        plan_of(NAME, chosen, "agents.parameters.jor={anchor=true}")
    said = f"with an anchor exactly one agent leads: formation.leaders has {len(leaders)}"
    assert said in str(told.value)
    assert "\n" not in str(told.value)
    # Without an anchor any number may lead, and the rate is that with the first agent as the anchor.
    (told,) = (found for found in plan_of(NAME, chosen).findings if found.check == "localization")
    assert (told.level, "agent 1 as the anchor" in told.says) == ("ok", True)


def off_at_the_end(run):
    return float(localization.distance(run.arrays["place"][-1], known(run)))


def test_half_of_the_messages_are_lost_and_the_answer_is_the_same_about_a_centroid_that_drifts():
    run = flown("network.availability=0.5", "time.duration=4")
    assert off_at_the_end(run) < 1e-6
    assert np.linalg.norm(centre_of(run)[-1]) > 0.01
    # Once all is settled, it does not move any more.
    assert np.abs(centre_of(run)[-1] - centre_of(run)[-20]).max() < 1e-6


def test_messages_that_are_five_ticks_late_lead_to_the_same_answer():
    late, now = flown(*FOUR, "network.delay_ticks=5"), flown(*FOUR)
    assert off_at_the_end(late) < 1e-6
    assert off_at_the_end(now) < 1e-9
    reached = [np.argmax(localization.distance(run.arrays["place"], known(run)) < 1e-3) for run in (late, now)]
    assert reached[0] > reached[1] + 5


def test_after_a_partition_is_healed_all_come_to_the_same_answer():
    split = timeline({"verb": "partition", "at": 0, "until": 1.0, "groups": [[1, 2, 3, 4, 5], [6, 7, 8, 9, 10]]})
    run = flown(split, "time.duration=4")
    off = localization.distance(run.arrays["place"], known(run))
    assert off[99] > 0.5
    assert off[-1] < 1e-9
    # Under the partition each half comes to its own answer.
    assert np.abs(np.diff(run.arrays["place"][60:99, :5], axis=0)).max() < 1e-2


def test_who_joins_late_and_the_others_come_to_the_same_answer():
    late = timeline({"verb": "kill", "at": 0, "agents": [4]}, {"verb": "restart", "at": 1.0, "agents": [4]})
    run = flown(*FOUR, late, "time.duration=4")
    assert np.isnan(run.arrays["place"][:100, 3]).all()
    assert np.isfinite(run.arrays["place"][100:]).all()
    assert np.isfinite(run.arrays["place"][:, :3]).all()
    assert off_at_the_end(run) < 1e-9


@pytest.mark.parametrize("state", ["warm", "cold"])
def test_who_is_restarted_and_the_others_come_to_the_same_answer(state):
    again = timeline(
        {"verb": "kill", "at": 0.5, "agents": [4]}, {"verb": "restart", "at": 1.0, "agents": [4], "state": state}
    )
    run = flown(*FOUR, again, "time.duration=4")
    assert off_at_the_end(run) < 1e-9


def test_who_is_restarted_and_measures_nothing_any_more_and_the_others_come_to_the_same_answer():
    blind = timeline(
        {"verb": "kill", "at": 0.5, "agents": [4]},
        {"verb": "restart", "at": 1.0, "agents": [4], "state": "cold"},
        {"verb": "dropout", "at": 1.0, "links": ["2->4", "3->4"]},
    )
    run = flown(*FOUR, blind, "time.duration=4")
    with_its_own = flown(*FOUR, "time.duration=4")
    assert np.abs(known(run).information - known(with_its_own).information).max() > 0.1
    assert off_at_the_end(run) < 1e-9


def test_who_is_paused_at_first_and_the_others_come_to_the_same_answer():
    asleep = timeline({"verb": "pause", "at": 0, "until": 1.0, "agents": [4]})
    assert off_at_the_end(flown(*FOUR, asleep, "time.duration=4")) < 1e-9


def test_three_dimensions_lead_to_the_optimum_too():
    solid = (
        "formation.nodes=[[0,0,0],[3,1,1],[1,4,-2],[4,5,2],[2,2,5]]",
        'formation.edges=["1-2","1-3","2-3","2-4","3-4","4-5","1-5"]',
    )
    run = flown(*solid, "time.duration=4")
    agents, made = by_hand(run)
    best, own = least_squares(agents, made, 0, 3), own_weights(agents, made, 3)
    assert run.arrays["place"].shape[-1] == 3
    np.testing.assert_allclose(run.arrays["place"][-1], best - middle(best, own), atol=1e-9)


def test_an_anchor_stays_at_the_origin_and_all_come_to_the_optimum_relative_to_it():
    run = flown(*FOUR, "agents.parameters.jor={h=0.49,anchor=true}")
    place = run.arrays["place"]
    agents, made = by_hand(run)
    np.testing.assert_array_equal(place[:, 2], np.zeros((400, 2)))
    np.testing.assert_allclose(place[-1], least_squares(agents, made, 2), atol=1e-9)
    assert np.abs(place[-1]).max() > 1.0


def test_many_runs_are_looked_at_as_each_alone():
    overrides = (*FOUR, "time.duration=0.5", "network.availability=0.5", "agents.parameters.jor={h=0.9}")
    runs = fly_all(plan_of(NAME, *overrides), [5, 6, 7], every=1)
    for row, seed in enumerate((5, 6, 7)):
        alone = flown(*overrides, f"seed={seed}")
        edges, place = known(alone), alone.arrays["place"]
        centre = centroid(place, weights(edges))
        np.testing.assert_allclose(
            runs.quantities["localization"][row], localization.distance(place, edges), atol=1e-12
        )
        np.testing.assert_allclose(
            runs.quantities["drift"][row], np.linalg.norm(centre - centre[0], axis=-1), atol=1e-12
        )
        np.testing.assert_array_equal(runs.quantities["ringing"][row], ringing(place))
    np.testing.assert_array_equal(runs.first["place"], flown(*overrides, "seed=5").arrays["place"])
    assert runs.quantities["ringing"].max() > 0.0
    assert np.isnan(runs.quantities["found"]).all()
    # Nothing is said of neighbours that could be as wrong as it says.
    assert np.isnan(runs.quantities["nees"]).all()


@pytest.mark.parametrize("every", [2, 3, 7])
def test_ringing_is_that_of_all_ticks_since_the_moment_before(every):
    plan = plan_of(NAME, *ROW, "time.duration=0.64", "agents.parameters.jor={h=0.99}")
    each, some = (fly_all(plan, [1, 2], every=ticks).quantities["ringing"] for ticks in (1, every))
    assert each.mean() > 0.5
    ticks = np.arange(0, 64, every)
    for row in range(2):
        expected = [each[row, max(tick - every + 1, 0) : tick + 1].mean() for tick in ticks]
        np.testing.assert_allclose(some[row], expected, atol=1e-12)
    counted = np.minimum(every, ticks + 1)
    np.testing.assert_allclose(some @ counted / counted.sum(), each[:, : ticks[-1] + 1].mean(axis=1), atol=1e-12)


def test_places_are_nearly_as_wrong_as_they_say_and_better_for_knowing_how_their_axes_hang_together():
    """Before: weights from an edge's own noise, NEES 3.1, and worse than with diagonals alone (.329 m for .324)."""
    found = {}
    for covariance in ("full", "diagonal"):
        parameters = f'agents.parameters.jor={{h=0.49,covariance="{covariance}"}}'
        found[covariance] = fly_all(plan_of(NAME, "time.duration=2", parameters), range(1, 121), 10).quantities
    nees = found["full"]["place_nees"][:, -1].mean()
    assert 2.0 < nees < 2.7
    full, diagonal = (found[one]["place_error"][:, -1] for one in ("full", "diagonal"))
    assert full.mean() < 0.3
    assert full.mean() < diagonal.mean()
