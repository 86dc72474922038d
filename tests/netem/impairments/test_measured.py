"""Files of measurements as people have them: what was measured over time, and delays."""

import numpy as np
import pytest

from netem.impairments import measured
from netem.impairments.measured import MeasuredError
from netem.impairments.trace import Measured


@pytest.fixture
def file(tmp_path):
    return tmp_path / "measured.csv"


def test_any_clock_meets_the_mean_over_time():
    rng = np.random.default_rng(1)
    links, length = 3, 4.0
    time = np.concatenate([np.zeros(links), rng.uniform(0.0, 5.0, 60)])
    one = Measured(time, np.concatenate([np.arange(links), rng.integers(0, links, 60)]), rng.random(links + 60))
    for dt in (0.001, 0.05, 0.4, 2.0):
        ticks = round(length / dt)
        changes, table = one.over(links, dt, ticks)
        held = np.diff(np.append(changes, ticks)) * dt
        for link in range(links):
            order = np.flatnonzero(one.link == link)[np.argsort(time[one.link == link])]
            lasts = np.diff(np.minimum(np.append(time[order], length), length))
            assert held @ table[:, link] == pytest.approx(lasts @ one.value[order], abs=1e-9)


LAST = "give delays of one way, in seconds, one a line"


# ---- delays


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("0.03\n0.01\n0.02\n", id="one a line"),
        pytest.param("delay\n0.01\n0.02\n0.03\n", id="a column"),
        pytest.param('"delay"\r\n"0.01"\r\n"0.02"\r\n"0.03"\r\n', id="a quoted column"),
        pytest.param("\ufeff# s, one way\n\n 0.01 \n1e-2\n3e-2\n0.02\n".replace("1e-2\n", ""), id="with comments"),
    ],
)
def test_delays_are_read_in_ascending_order(text, file):
    file.write_text(text, encoding="utf-8")
    assert measured.delays(file).tolist() == [0.01, 0.02, 0.03]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "there is no delay in it: give one a line, in seconds"),
        ("delay\n", "there is no delay in it"),
        ("0.1\n\nfast\n", "line 3: one delay in seconds is due, at least 0, like 0.012; got 'fast'"),
        ("0.1\n-0.1\n", "line 2: one delay in seconds is due"),
        ("nan\n", "line 1: one delay in seconds is due"),
        ("inf\n", "line 1: one delay in seconds is due"),
        ("0.1,0.2\n", "line 1: one delay in seconds is due"),
        ("64 bytes from 10.0.0.2: icmp_seq=1 ttl=64 time=12.3 ms\n", f"line 1: the output of ping, .*; {LAST}"),
        ("PING 10.0.0.2 (10.0.0.2) 56(84) bytes of data.\n", f"line 1: the output of ping, .*; {LAST}"),
    ],
)
def test_delays_that_are_wrong_say_where(text, says, file):
    file.write_text(text)
    with pytest.raises(MeasuredError, match=says):
        measured.delays(file)
