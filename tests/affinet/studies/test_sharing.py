"""How the runs of a study are shared out over batches and processors, and put together again."""

import numpy as np
import pytest
from flying import plan_of

from affinet.studies.batch import Runs
from affinet.studies.sharing import Piece, batches, flown_by_case, in_turn, missing
from analysis.metrics.indicator import Bounds

SHORT = ("time.dt=0.05", "time.duration=0.5")


def plans(*estimators):
    """For each, one at two availabilities: these two are alike."""
    return [
        plan_of("corridor", *SHORT, f'agents.estimator="{one}"', f"network.availability={share}")
        for one in estimators
        for share in (0.5, 1.0)
    ]


def whole(given, runs):
    return missing((), len(given), runs)


def sizes(shared):
    return [sum(len(piece.runs) for piece in batch) for batch in shared]


@pytest.mark.parametrize("processors", [1, 2, 3, 8])
@pytest.mark.parametrize("runs", [1, 2, 7, 50, 101, 450])
@pytest.mark.parametrize("estimators", [("none",), ("none", "rkf"), ("none", "rkf", "none")])
def test_every_run_flies_once_beside_those_that_are_alike(estimators, runs, processors):
    given = plans(*estimators)
    shared = batches(given, whole(given, runs), processors)
    flown = {
        case: [run for batch in shared for piece in batch if piece.case == case for run in piece.runs]
        for case in range(len(given))
    }
    assert flown == {case: list(range(runs)) for case in range(len(given))}
    for batch in shared:
        assert len({given[piece.case].estimator.path for piece in batch}) == 1
        assert all(piece.runs for piece in batch)
    assert max(sizes(shared)) <= 200
    assert len(shared) >= min(processors, runs * len(given))
    # As many batches as keep all processors busy to the end, and no more than that.
    needed = sum(-(-runs * estimators.count(one) * 2 // 200) for one in set(estimators))
    assert len(shared) < needed + processors
    assert len(shared) % processors == 0 or max(sizes(shared)) == 1
    assert [batch[0].case for batch in shared] == sorted(batch[0].case for batch in shared)


def test_a_case_of_many_runs_is_flown_by_all_processors():
    assert batches(plans("none")[:1], [Piece(0, range(100))], 2) == [
        (Piece(0, range(50)),),
        (Piece(0, range(50, 100)),),
    ]


def test_cases_of_few_runs_fly_at_once():
    given = plans("none", "rkf")
    assert batches(given, whole(given, 50), 2) == [
        (Piece(0, range(50)), Piece(1, range(50))),
        (Piece(2, range(50)), Piece(3, range(50))),
    ]


def made_up(runs):
    """Runs that say which they are."""
    of = np.array(runs, dtype=np.float64)
    return Runs(
        np.zeros(1),
        of,
        of[:, None, None],
        Bounds(*of[None, :, None, None].repeat(2, 0)),
        {"error": of[:, None]},
        {"position": of[:1]},
    )


def test_each_case_comes_in_its_turn_with_its_runs_in_their_order():
    done = [Piece(0, range(3)), Piece(2, range(1, 3)), Piece(1, range(3)), Piece(2, range(1))]
    asked = []

    def flown():
        for number, piece in enumerate(done):
            asked.append(number)
            yield piece, made_up([10 * piece.case + run for run in piece.runs])

    coming = in_turn(flown(), 3, 3)
    for case, pieces_by_then in enumerate(([0], [0, 1, 2], [0, 1, 2, 3])):
        runs = next(coming)
        expected = [10.0 * case + run for run in range(3)]
        np.testing.assert_array_equal(runs.mean_error, expected)
        np.testing.assert_array_equal(runs.quantities["error"][:, 0], expected)
        assert runs.first["position"] == 10.0 * case
        assert asked == pieces_by_then  # no case waits for pieces of those behind it
    assert not list(coming)


def test_shares_of_batches_are_told_as_shares_of_cases():
    shared = [(Piece(0, range(4)), Piece(1, range(1))), (Piece(1, range(1, 3)),)]
    assert flown_by_case([0.5, 0.0], shared, [Piece(1, range(3, 4))], 2, 4) == [0.5, 0.375]
    assert flown_by_case([1.0, 1.0], shared, [Piece(1, range(3, 4))], 2, 4) == [1.0, 1.0]


def test_what_is_missing_are_the_gaps_between_what_is_there():
    there = [Piece(1, range(6, 8)), Piece(0, range(9)), Piece(1, range(2, 4))]
    gaps = [Piece(1, range(2)), Piece(1, range(4, 6)), Piece(1, range(8, 9)), Piece(2, range(9))]
    assert missing(there, 3, 9) == gaps
    assert missing([*there, *gaps], 3, 9) == []


@pytest.mark.parametrize("at_once", [1, 2, 5])
def test_what_is_missing_is_shared_out_anew(at_once):
    given = plans("none", "rkf")
    wanted = missing([Piece(0, range(3, 30)), Piece(1, range(50)), Piece(2, range(20, 50))], 4, 50)
    pieces = [piece for batch in batches(given, wanted, at_once) for piece in batch]
    flown = {case: sorted(run for piece in pieces if piece.case == case for run in piece.runs) for case in range(4)}
    assert flown == {0: [*range(3), *range(30, 50)], 1: [], 2: [*range(20)], 3: [*range(50)]}
    assert len(batches(given, wanted, at_once)) % at_once == 0
