"""What liars say: their maps multiplied from the left, whoever believes them, and nothing else."""

import numpy as np
import pytest

from netem.faults import lie
from netem.faults.fault import Fault, Verb


def liar(*rows):
    return Fault(Verb.LIE, 0, None, agents=(1,), matrix=rows)


MIRROR = liar((0.0, 1.0), (-1.0, 0.5))
MAP = np.array([[1.0, 2.0], [3.0, 4.0]])


def test_a_map_is_multiplied_from_the_left():
    assert lie.told({"local": MAP}, MIRROR)["local"].tolist() == [[3.0, 4.0], [0.5, 0.0]]


def test_every_map_of_a_batch_is_multiplied():
    batch = np.stack([MAP, 2.0 * MAP, np.eye(2)])
    told = lie.told({"local": batch}, MIRROR)["local"]
    np.testing.assert_array_equal(told, [[[3, 4], [0.5, 0]], [[6, 8], [1, 0]], [[0, 1], [-1, 0.5]]])


def test_one_map_is_told_bit_for_bit_as_in_a_batch():
    batch = np.random.default_rng(1).normal(size=(50, 2, 2))
    told = lie.told({"local": batch}, MIRROR)["local"]
    assert all(
        lie.told({"local": one}, MIRROR)["local"].tobytes() == said.tobytes()
        for one, said in zip(batch, told, strict=True)
    )


def test_what_is_no_map_is_told_as_it_is():
    fields = {"local": MAP, "feasible": np.array(True), "rows": np.ones((3, 2)), "vector": np.array([1.0, 2.0])}
    told = lie.told(fields, MIRROR)
    assert told.keys() == fields.keys()
    assert (told["local"] != MAP).any()
    for name in ("feasible", "rows", "vector"):
        assert told[name] is fields[name]


def test_the_truth_is_left_as_it_was():
    fields = {"local": MAP.copy()}
    lie.told(fields, MIRROR)
    np.testing.assert_array_equal(fields["local"], MAP)


def test_of_two_lies_the_second_is_about_the_first():
    twice = lie.told(lie.told({"local": MAP}, MIRROR), liar((2.0, 0.0), (0.0, 3.0)))["local"]
    np.testing.assert_array_equal(twice, np.diag([2.0, 3.0]) @ MIRROR.matrix @ MAP)


@pytest.mark.parametrize("dimension", [2, 3])
def test_maps_of_the_dimension_of_the_lie_are_told_falsely_and_no_others(dimension):
    told = lie.told({"plane": np.eye(2), "space": np.eye(3)}, liar(*np.ones((dimension, dimension)).tolist()))
    changed = {name for name, field in told.items() if (field == 1.0).all()}
    assert changed == {{2: "plane", 3: "space"}[dimension]}
