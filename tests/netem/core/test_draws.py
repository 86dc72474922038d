"""Draws are Philox-4x32-10, a pure function of what they are for."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy import stats

from netem.core import channels, draws
from netem.core.draws import DrawnAhead, Purpose, philox, uniform


@pytest.mark.parametrize(
    ("counter", "key", "expected"),
    [
        ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
        ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
        ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
    ],
    ids=["zeros", "ones", "pi"],
)
def test_philox_gives_the_published_answers_of_random123(counter, key, expected):
    def words(text):
        return tuple(np.array(int(word, 16), dtype=np.uint64) for word in text.split())

    assert philox(words(counter), words(key)) == words(expected)


def test_a_draw_is_the_first_52_bits_of_the_block_that_its_indices_count():
    counter = (5, 3 << 16 | 4, 9, Purpose.SENSOR_NOISE << 16)
    seed = 0x0123456789ABCDEF
    high, low, _, _ = philox(
        tuple(np.array(word, dtype=np.uint64) for word in counter),
        (np.array(0x89ABCDEF, dtype=np.uint64), np.array(0x01234567, dtype=np.uint64)),
    )
    (draw,) = uniform(seed, Purpose.SENSOR_NOISE, tick=5, src=3, dst=4, channel=9)
    assert int(draw * 2**52) == int(high) << 20 | int(low) >> 12


@pytest.mark.parametrize("word", [0x00000000, 0xFFFFFFFF])
def test_neither_0_nor_1_can_be_drawn(word):
    assert 0.0 < draws.unit(np.uint64(word), np.uint64(word)) < 1.0


def test_no_two_purposes_share_a_draw():
    drawn = np.concatenate([uniform(1, purpose, tick=np.arange(50)).ravel() for purpose in Purpose])
    assert len(np.unique(drawn)) == 50 * len(Purpose)


def test_draws_are_uniform():
    u = uniform(7, Purpose.LOSS, tick=np.arange(500)[:, None], src=2, dst=np.arange(100), lanes=2).ravel()
    assert len(u) == 100_000
    assert ((u > 0.0) & (u < 1.0)).all()
    assert abs(u.mean() - 1 / 2) < 3 * np.sqrt(1 / 12 / 1e5)
    assert abs(u.var() - 1 / 12) < 3 * np.sqrt(1 / 180 / 1e5)
    assert stats.kstest(u, "uniform").pvalue > 0.01


@pytest.mark.parametrize("index", ["tick", "src", "dst", "channel"])
def test_draws_of_neighbouring_indices_are_uncorrelated(index):
    u = uniform(7, Purpose.LOSS, **{index: np.arange(20_001)})[:, 0]
    assert abs(np.corrcoef(u[:-1], u[1:])[0, 1]) < 3 / np.sqrt(20_000)


def test_lanes_are_uncorrelated():
    u = uniform(7, Purpose.LOSS, tick=np.arange(20_000), lanes=3)
    correlation = np.corrcoef(u.T)[np.triu_indices(3, k=1)]
    assert (abs(correlation) < 3 / np.sqrt(20_000)).all()


def test_broadcasting_equals_one_at_a_time():
    ticks, sources, targets, codes = [0, 7, 2**32 - 1], [1, 2**16 - 1], [3, 4], [0, 2**32 - 1]
    tick, src, dst, channel = np.ix_(ticks, sources, targets, codes)
    block = uniform(3, Purpose.LOSS, tick=tick, src=src, dst=dst, channel=channel, lanes=3)
    assert block.shape == (3, 2, 2, 2, 3)
    for (t, s, d, c), _ in np.ndenumerate(block[..., 0]):
        alone = uniform(3, Purpose.LOSS, tick=ticks[t], src=sources[s], dst=targets[d], channel=codes[c], lanes=3)
        assert (block[t, s, d, c] == alone).all()


def test_more_lanes_move_no_earlier_lane():
    few, many = uniform(1, Purpose.LOSS, tick=[1, 2], lanes=3), uniform(1, Purpose.LOSS, tick=[1, 2], lanes=8)
    assert (many[:, :3] == few).all()
    assert len(np.unique(many)) == 16


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 2},
        {"seed": 1 + 2**32},
        {"purpose": Purpose.SENSOR_NOISE},
        {"purpose": Purpose.PROCESS_NOISE},
        {"purpose": Purpose.INITIAL_POSITION},
        {"tick": 11},
        {"src": 4},
        {"dst": 4},
        {"src": 2, "dst": 3},
        {"channel": 6},
    ],
    ids=str,
)
def test_another_index_gives_other_draws(other):
    this = {"seed": 1, "purpose": Purpose.LOSS, "tick": 10, "src": 3, "dst": 2, "channel": 5, "lanes": 64}
    assert not np.isin(uniform(**this), uniform(**this | other)).any()


@pytest.mark.parametrize(
    ("index", "match"),
    [
        ({"tick": -1}, r"tick must lie in \[0, 2\*\*32\).*-1"),
        ({"tick": 2**32}, r"tick must lie in \[0, 2\*\*32\).*4294967296"),
        ({"tick": [0, 5, -3]}, r"tick must lie in .*-3 to 5"),
        ({"src": 2**16}, r"src must lie in \[0, 2\*\*16\).*65536"),
        ({"src": -1}, r"src must lie in .*-1"),
        ({"dst": 2**16}, r"dst must lie in \[0, 2\*\*16\).*65536"),
        ({"dst": [1, -1]}, r"dst must lie in .*-1 to 1"),
        ({"channel": 2**32}, r"channel must lie in \[0, 2\*\*32\)"),
        ({"seed": -1}, r"seed -1 is outside \[0, 2\*\*64\)"),
        ({"seed": 2**64}, r"seed 18446744073709551616 is outside"),
        ({"lanes": 2**17 + 1}, r"lanes.*2\*\*17"),
    ],
    ids=str,
)
def test_an_index_that_would_share_a_draw_with_another_is_refused(index, match):
    with pytest.raises(ValueError, match=match):
        uniform(**{"seed": 1, "purpose": Purpose.LOSS} | index)


def test_no_indices_give_no_draws():
    assert uniform(1, Purpose.LOSS, tick=np.arange(0)).shape == (0, 1)


def test_a_tape_equals_the_function_it_wraps():
    def draw(ticks):
        return uniform(5, Purpose.LOSS, tick=ticks[:, None], src=[1, 2, 3])

    tape = DrawnAhead(draw, span=64)
    for tick in [0, 1, 63, 64, 1000, 5, 65]:
        assert (tape.at(tick) == draw(np.array([tick]))[0]).all()


def test_a_tape_draws_a_span_at_once():
    drawn = []
    tape = DrawnAhead(lambda ticks: drawn.append(ticks.tolist()) or ticks, span=4)
    assert [tape.at(tick) for tick in range(6)] == [0, 1, 2, 3, 4, 5]
    assert drawn == [[0, 1, 2, 3], [4, 5, 6, 7]]


def test_a_channel_is_counted_by_its_name_alone():
    assert (channels.code("theta"), channels.code("sense")) == (186157577, 254489595)


@pytest.mark.parametrize("hash_seed", ["0", "1", "4242"])
def test_another_process_with_another_hash_seed_draws_the_same_numbers(hash_seed):
    program = (
        "import json; from netem.core.channels import code; from netem.core.draws import Purpose, uniform; "
        "print(json.dumps(uniform(9, Purpose.LOSS, tick=[1, 2], src=3, channel=code('theta'), lanes=2).tolist()))"
    )
    environment = os.environ | {"PYTHONHASHSEED": hash_seed}
    printed = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, check=True).stdout
    here = uniform(9, Purpose.LOSS, tick=[1, 2], src=3, channel=channels.code("theta"), lanes=2)
    assert json.loads(printed) == here.tolist()
