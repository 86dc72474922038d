"""Manoeuvres from CSV: a path of the formation, or one of each leader."""

import numpy as np
import pytest
from flying import plan_of

from affinet.planning import paths
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario.wrong import ScenarioError
from netem.impairments.measured import MeasuredError
from world.formation.nominal import Formation

SECONDS = np.arange(101) * 0.1
SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]])
WING = Formation(SQUARE, ((1, 2), (2, 4), (3, 4), (1, 3)), (1, 2, 3), None)
FOUR = Formation(SQUARE, WING.edges, (1, 2, 3, 4), None)
# The first rests, the second swings out, the third goes up: the square is stretched and sheared.
EACH = "time,leader,x,y\n0,1,0,0\n10,1,0,0\n0,2,2,0\n4,2,5,1\n10,2,6,2\n0,3,0,2\n10,3,0,8\n"


@pytest.fixture
def flown(tmp_path):
    def of(text, formation=WING, seconds=SECONDS):
        (tmp_path / "path.csv").write_text(text)
        return paths.manoeuvre_of(tmp_path / "path.csv", formation, seconds, 0.1)

    return of


def places(manoeuvre, nominal=SQUARE):
    """Where all would be, shape (T, N, D)."""
    return np.einsum("tij,nj->tni", manoeuvre.theta, nominal) + manoeuvre.offset[:, None]


def test_a_path_of_the_formation_moves_it_as_it_is(flown):
    found = flown("time,x,y\n1,0,0\n5,8,-4\n")
    assert (found.theta == np.eye(2)).all()
    assert found.offset[[0, 10, 50, 100]].tolist() == [[0, 0], [0, 0], [8, -4], [8, -4]]
    np.testing.assert_allclose(found.offset[30], [4.0, -2.0])


def test_each_leader_flies_its_own_path(flown):
    where = places(flown(EACH))
    np.testing.assert_allclose(where[0], SQUARE, atol=1e-12)
    np.testing.assert_allclose(where[40, 1], [5.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(where[100], [[0, 0], [6, 2], [0, 8], [6, 10]], atol=1e-12)  # the last as the map has it
    np.testing.assert_allclose(where[50, 2], [0.0, 5.0], atol=1e-12)


def test_more_leaders_than_a_map_needs_fly_where_it_has_them_or_are_refused(flown):
    fourth = "0,4,2,2\n10,4,2,2\n"
    with pytest.raises(MeasuredError, match=r"leader \d is 2\.\d* m off the affine map of all leaders"):
        flown(EACH + fourth, FOUR)
    straight = "".join(f"0,{n},{x:g},{y:g}\n10,{n},{2 * x:g},{y + 1:g}\n" for n, (x, y) in enumerate(SQUARE, start=1))
    where = places(flown("time,leader,x,y\n" + straight, FOUR))
    np.testing.assert_allclose(where[100], SQUARE * [2.0, 1.0] + [0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time,x\n0,1\n", "line 1: the columns must be time,x,y, or with leader, got 'time,x'"),
        ("", "line 1: the columns must be time,x,y"),
        ("time,x,y,z\n0,0,0,0\n", "line 1: the columns must be time,x,y"),
        ("time,x,y\n", "there is no point in it: give at least two"),
        ("time,x,y\n0,0,0\n", "line 2: the path of the formation has one point"),
        ("time,x,y\n0,0,0\n1,far,0\n", "line 3: a number is due for x in m; got 'far'"),
        ("time,x,y\n0,0,0\n1,0\n", "line 3: 3 cells are due, got '1,0'"),
        ("time,x,y\n1,0,0\n1.01,1,1\n", r"line 3: 1.01 s is less than a tick \(0.1 s\) after the point before it"),
        ("time,x,y\n-1,0,0\n1,1,1\n", "line 2: a number is due for a time in s, at least 0"),
        ("time,leader,x,y\n0,1.5,0,0\n", "line 2: a leader is the number of an agent"),
        ("time,leader,x,y\n0,4,0,0\n1,4,0,0\n", "line 2: agent 4 leads nobody; leaders are 1, 2, 3"),
        ("time,leader,x,y\n0,1,0,0\n1,1,0,0\n", "leader 2 has no path: give one to each of 1, 2, 3"),
    ],
)
def test_what_is_malformed_says_where(text, says, flown):
    with pytest.raises(MeasuredError, match=says) as caught:
        flown(text)
    assert "\n" not in str(caught.value)


def test_leaders_in_a_line_leave_the_others_open(flown):
    line = Formation(SQUARE, WING.edges, (1, 2), None)
    with pytest.raises(MeasuredError, match="the leaders 1, 2 do not span the 2 dimensions"):
        flown("time,leader,x,y\n0,1,0,0\n1,1,0,0\n0,2,2,0\n1,2,3,0\n", line)


def test_a_scenario_flies_a_path(tmp_path):
    (tmp_path / "path.csv").write_text("time,x,y\n0,0,0\n1,1,0\n")
    given = (f'manoeuvre={{file="{tmp_path}/path.csv"}}', "time.dt=0.05", "time.duration=1.5", "seed=4")
    made = plan_of("corridor", *given)
    assert made.world.manoeuvre.offset[-1].tolist() == [1.0, 0.0]
    assert np.isfinite(rehearse(made).arrays["position"]).all()
    with pytest.raises(ScenarioError, match=r"manoeuvre.file: .*none.csv: no such file"):
        plan_of("corridor", 'manoeuvre={file="none.csv"}')
