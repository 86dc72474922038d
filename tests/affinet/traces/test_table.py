"""Tables of what links are worth, as people have them."""

import numpy as np
import pytest

from affinet.planning import traces
from affinet.scenario.sections import TimeSection
from affinet.scenario.trace_files import Traced
from affinet.traces.link_data import Quantity
from netem.core.links import Links
from netem.impairments import trace

PAIR = Links.both_ways(2, [(1, 2)])
WHEEL = Links.both_ways(8, [(1, n) for n in range(2, 9)])
HEADER = "time,src,dst,availability\n"
THERE, BACK = PAIR.index[1, 2], PAIR.index[2, 1]


@pytest.fixture
def file(tmp_path):
    return tmp_path / "measured.csv"


def read(file, text, links=PAIR, rows=None, dt=0.01, ticks=100):
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    rows = np.ones(len(links), dtype=bool) if rows is None else rows
    time = TimeSection(dt=dt, duration=dt * ticks)
    given, _ = traces.measured(Traced(model="trace", file=str(file)), Quantity.AVAILABILITY, links, rows, time)
    return trace.table(given, links, rows, dt, ticks)


def test_a_trace_holds_each_value_until_the_next(file):
    ticks, table = read(file, HEADER + "0,1,2,0.9\n0,2,1,0.8\n0.05,1,2,0.5\n0.07,2,1,0\n")
    assert ticks.tolist() == [0, 5, 7]
    assert table[:, THERE].tolist() == [0.9, 0.5, 0.5]
    assert table[:, BACK].tolist() == [0.8, 0.8, 0.0]


def test_links_that_need_no_trace_always_pass_and_need_no_rows(file):
    needed = np.arange(2) == THERE
    for more in ("0,2,1,0\n", ""):
        _, table = read(file, HEADER + "0,1,2,0.25\n" + more, rows=needed)
        assert table[0].tolist() == np.where(needed, 0.25, 1.0).tolist()


# The same trace: 1->2 is worth .9, and .5 from .05 s; 2->1 is worth .8.
SAME = {
    "as documented": HEADER + "0,1,2,0.9\n0,2,1,0.8\n0.05,1,2,0.5\n",
    "in any order": HEADER + "0.05,1,2,0.5\n0,2,1,0.8\n0,1,2,0.9\n",
    "with a byte order mark": b"\xef\xbb\xbf" + HEADER.encode() + b"0,1,2,0.9\n0,2,1,0.8\n0.05,1,2,0.5\n",
    "in UTF-16": (HEADER + "0,1,2,0.9\n0,2,1,0.8\n0.05,1,2,0.5\n").encode("utf-16"),
    "with a comment in latin-1": b"# Stra\xdfe\n" + HEADER.encode() + b"0,1,2,0.9\n0,2,1,0.8\n0.05,1,2,0.5\n",
    "by semicolons": "time;src;dst;availability\n0;1;2;0.9\n0;2;1;0.8\n0.05;1;2;0.5\n",
    "by semicolons, with decimal commas": "time;src;dst;availability\n0;1;2;0,9\n0;2;1;0,8\n0,05;1;2;0,5\n",
    "for a spreadsheet": "sep=;\r\ntime;src;dst;availability\r\n0;1;2;0,9\r\n0;2;1;0,8\r\n0,05;1;2;0,5\r\n",
    "by tabs": "time\tsrc\tdst\tavailability\n0\t1\t2\t0.9\n0\t2\t1\t0.8\n0.05\t1\t2\t0.5\n",
    "with ids of a table of floats": HEADER + "0.0,1.0,2.0,0.9\n0.0,2.0,1.0,0.8\n0.05,1.0,2.0,0.5\n",
    "in percent": HEADER + "0,1,2,90 %\n0,2,1,80%\n0.05,1,2,0.5\n",
    "in percent with commas": "time;src;dst;availability\n0;1;2;90,0 %\n0;2;1;80%\n0,05;1;2;50%\n",
    "quoted": '"time","src","dst","availability"\n"0","1","2","0.9"\n"0","2","1","0.8"\n"0.05","1","2","0.5"\n',
    "with capitals and spaces": " Time , SRC, Dst ,Availability\n 0 , 1, 2, 0.9\n0,2,1,0.8\n0.05,1,2,0.5\n",
    "with other columns first": "availability,dst,src,time\n0.9,2,1,0\n0.8,1,2,0\n0.5,2,1,0.05\n",
    "with blank lines and comments": "\n# mine\n" + HEADER + "\n0,1,2,0.9\n  \n0,2,1,0.8\n  # then\n0.05,1,2,0.5\n\n",
    "with the ends of lines of DOS": HEADER.strip() + "\r\n0,1,2,0.9\r\n0,2,1,0.8\r\n0.05,1,2,0.5\r\n",
    "with rows that are there twice": HEADER + "0,1,2,0.9\n0,2,1,0.8\n0.05,1,2,0.5\n0,1,2,0.9\n",
    "with rows after the end of the run": HEADER + "0,1,2,0.9\n0,2,1,0.8\n0.05,1,2,0.5\n1e9,1,2,0\n1e11,2,1,0\n",
}


@pytest.mark.parametrize("text", SAME.values(), ids=SAME)
def test_the_same_trace_in_other_words(text, file):
    ticks, table = read(file, text)
    assert ticks.tolist() == [0, 5]
    assert table[:, THERE].tolist() == [0.9, 0.5]
    assert table[:, BACK].tolist() == [0.8, 0.8]


@pytest.mark.parametrize(
    ("rows", "ticks", "there"),
    [
        pytest.param("0,1,2,1\n0.03,1,2,0\n0.04,1,2,0.5\n", [0, 1], [0.7, 0.5], id="several in a tick"),
        pytest.param("0,1,2,1\n0.125,1,2,0\n", [0, 2, 3], [1.0, 0.5, 0.0], id="one within a tick"),
        pytest.param("0,1,2,1\n0.025,1,2,0\n0.05,1,2,1\n", [0, 1], [0.5, 1.0], id="up to the next tick"),
        pytest.param("0,1,2,1\n0.02,1,2,0\n0.08,1,2,1\n", [0, 1, 2], [0.4, 0.4, 1.0], id="across two ticks"),
        pytest.param("0,1,2,1\n0.01,1,2,1\n0.03,1,2,1\n", [0, 1], [1.0, 1.0], id="all of them alike"),
        pytest.param("0,1,2,1\n0.1500000001,1,2,0\n", [0, 3], [1.0, 0.0], id="meant for the beginning of a tick"),
    ],
)
def test_a_tick_has_the_mean_over_its_time(rows, ticks, there, file):
    """Before: the last row of a tick won, two rows in one tick were refused, and a change was rounded to a whole tick."""
    changes, table = read(file, HEADER + rows, rows=np.arange(2) == THERE, dt=0.05, ticks=20)
    assert changes.tolist() == ticks
    np.testing.assert_allclose(table[:, THERE], there, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        pytest.param(
            "time,src,dst,loss\n",
            r"line 1: the columns must be time,src,dst and one or more of availability, .*, got 'time,src,dst,loss'",
        ),
        pytest.param("time,src,dst,availability,colour\n", "line 1: the columns must be"),
        pytest.param("", "line 1: the columns must be .*, got none"),
        pytest.param(HEADER, "line 1: a heading and no row below it"),
        pytest.param(HEADER + "0.5,1,2,1\n0.5,2,1,1\n", "must begin at time 0"),
        pytest.param(
            HEADER + "0,1,2,1\n\n0,2,one,1\n",
            "line 4: node one is none of the agents 1 to 2",
        ),
        pytest.param(HEADER + "0,1,2\n", "line 2: four numbers are due, got '0,1,2'"),
        pytest.param(HEADER + "0,1,2,1,1\n", "line 2: four numbers are due, got"),
        pytest.param(HEADER + "0,1,2,1,1\n0,2,1,1,1\n", "line 2: four numbers are due, got"),
        pytest.param(HEADER + "0,1.5,2,1\n", "line 2: node 1.5 is none of the agents 1 to 2"),
        pytest.param(HEADER + "0,1,2,1.5\n", r"line 2: .*lie in \[0, 1\]"),
        pytest.param(HEADER + "0,1,2,50\n", "line 2: .* or be written with a % like 50 %"),
        pytest.param(HEADER + "0,1,2,nan\n", r"line 2: .*lie in \[0, 1\]"),
        pytest.param(HEADER + "nan,1,2,1\n", "line 2: time must be at least 0 s"),
        pytest.param(HEADER + "0,nan,2,1\n", "line 2: node nan is none of the agents"),
        pytest.param(HEADER + "-1,1,2,1\n", "line 2: time must be at least 0 s"),
        pytest.param(HEADER + "inf,1,2,1\n", "line 2: time must be at least 0 s"),
        pytest.param(HEADER + "0,1,1,1\n", "line 2: 1->1 is not a link"),
        pytest.param(HEADER + "0,1,2,1\n0,1,3,1\n", "line 3: node 3 is none of the agents"),
        pytest.param(HEADER + "0,1,1e300,1\n", r"line 2: node 1e\+300 is none of the agents"),
        pytest.param(HEADER + "0,1,2,1\n0.1,2,1,1\n", "no availability at time 0 for 2->1$"),
        pytest.param(HEADER + "0,1,2,1\n0,2,1,1\n0,1,2,0.5\n", "line 4: 1->2 has two values at 0 s"),
        pytest.param(HEADER + '0,1,2,"1\n0,2,1,1\n', "line 2: a quote is opened and never closed"),
        pytest.param(HEADER + '0,1,2,x"1,"2\n0,2,1,1\n', "line 2: four numbers are due"),
        pytest.param(HEADER + "0,1,2," + "1" * 200_000 + "x\n", "line 2: four numbers are due, got '0,1,2,111"),
        pytest.param(HEADER + '0,1,2,"0,5"\n', "line 2: four numbers are due"),
        pytest.param(HEADER + "0,1,2,50 % 3\n", "line 2: four numbers are due"),
        pytest.param(HEADER.encode("utf-16-le") + "0,1,2,1\n".encode("utf-16-le"), "save it as UTF-8"),
        pytest.param(b"\x00\x01\x02\xff", "save it as UTF-8"),
    ],
)
def test_a_trace_that_is_wrong_says_where(text, says, file):
    with pytest.raises(ValueError, match=says) as caught:
        read(file, text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 250


def test_of_many_links_without_a_trace_the_first_are_named(file):
    with pytest.raises(ValueError, match=r"2->1, .* and 7 more$"):
        read(file, HEADER + "0,1,2,1\n", links=WHEEL)
