"""Files of link data as the air of a run: nodes as agents, curves, times, and what is said of it."""

import numpy as np
import pytest

from affinet.planning import traces
from affinet.scenario.sections import TimeSection
from affinet.scenario.trace_files import Traced
from affinet.traces.link_data import Quantity
from netem.core.links import Links
from netem.impairments import trace
from netem.impairments.measured import MeasuredError

LINE = Links.both_ways(3, [(1, 2), (2, 3)])
EVERY = np.ones(len(LINE), dtype=bool)
CONTACTS = "0 1 2 up\n2 1 2 down\n1 1 3 up\n".replace("2 1 2 down\n1 1 3 up\n", "1 1 3 up\n2 1 2 down\n")


@pytest.fixture
def onto(tmp_path):
    """When availability changes, what it is by link, and the notes."""

    def of(text, what=Quantity.AVAILABILITY, rows=EVERY, duration=4.0, dt=0.5, **meaning):
        (tmp_path / "field.txt").write_text(text)
        time = TimeSection(dt=dt, duration=duration)
        said = Traced.model_validate({"model": "trace", "file": str(tmp_path / "field.txt")} | meaning)
        given, notes = traces.measured(said, what, LINE, rows, time)
        ticks, table = trace.table(given, LINE, rows, dt, time.ticks)
        return ticks.tolist(), {pair: table[:, row].tolist() for pair, row in LINE.index.items()}, notes

    return of


def test_contacts_by_the_numbers_of_agents(onto):
    ticks, worth, notes = onto(CONTACTS)
    assert ticks == [0, 4]
    assert worth[1, 2] == worth[2, 1] == [1.0, 0.0]
    assert worth[2, 3] == worth[3, 2] == [0.0, 0.0]  # who never met
    assert any("2 pairs are in it that are no links" in note for note in notes)
    assert any("its last row is of 2 s" in note for note in notes)


def test_nodes_from_0_and_nodes_by_name(onto):
    shifted = "0 0 1 up\n2 0 1 down\n"
    with pytest.raises(MeasuredError, match=r"line 1: node 0 is none of the agents 1 to 3: .* agents = .* first = "):
        onto(shifted)
    assert onto(shifted, first=0)[1][1, 2] == [1.0, 0.0]
    named = "0 a b up\n1 b c up\n2 a b down\n"
    assert onto(named, agents={"b": 2, "a": 3})[1][3, 2] == [1.0, 0.0]
    with pytest.raises(MeasuredError, match="agents: it has no node 'z'; it has a, b, c"):
        onto(named, agents={"z": 1})
    with pytest.raises(MeasuredError, match="agents: 'a' cannot be agent 4: there are 3"):
        onto(named, agents={"a": 4})


def test_a_run_may_begin_within_a_file(onto):
    ticks, worth, _ = onto("0 1 2 up\n101 1 2 down\n103 1 2 up\n", begins=100.0)
    assert ticks == [0, 2, 6]
    assert worth[1, 2] == [1.0, 0.0, 1.0]
    table = "time,src,dst,availability\n1e9,1,2,0.5\n1e9,2,1,0.5\n"
    with pytest.raises(ValueError, match=r"must begin at time 0, its first row is of 1e\+09 s; begins = "):
        onto(table, rows=np.array([pair in ((1, 2), (2, 1)) for pair in LINE.index]))


def test_a_file_of_one_link_is_all_links_that_have_it(onto):
    ping = (
        "PING b\n64 bytes from b: icmp_seq=1 time=2 ms\n64 bytes from b: icmp_seq=3 time=2 ms\n3 packets transmitted\n"
    )
    ticks, worth, notes = onto(ping, interval=0.5)
    assert (ticks, worth[1, 2], worth[3, 2]) == ([0, 1, 2], [1.0, 0.0, 1.0], [1.0, 0.0, 1.0])
    assert any("the 4 links that have it are all worth the same" in note for note in notes)
    assert any("half of one is taken" in note for note in notes)
    assert onto(ping)[0] == [0, 2, 4]  # one a second, which is said
    assert any("one every 1 s is taken" in note for note in onto(ping)[2])
    assert onto(ping, what=Quantity.DELAY)[1][1, 2][0] == 0.001


def test_a_mahimahi_trace_begins_anew(onto):
    _, worth, _ = onto("1\n500\n1000\n", what=Quantity.RATE, dt=0.25, duration=2.0)
    assert worth[1, 2] == pytest.approx([12000 / 0.25, 12000 / 0.25, 0.0, 12000 / 0.25] * 2)


def test_signals_and_pathloss_by_a_curve(onto):
    table = "time,src,dst,rssi\n" + "".join(f"0,{i},{j},{-80 if i < j else -95}\n" for i, j in LINE.index)
    worth = onto(table, curve=[[-90, 0.0], [-70, 0.8]])[1]
    assert worth[1, 2] == [0.4]
    assert worth[2, 1] == [0.0]
    with pytest.raises(MeasuredError, match=r"it says rssi: how much passes at so many dBm\? say it by curve = "):
        onto(table)
    with pytest.raises(MeasuredError, match="it says rssi, and the curve is one by distance: give points"):
        onto(table, curve={"model": "disk", "range": 5.0})
    emane = onto("1 nem:1 pathloss nem:2,90,100\n", curve=[[90, 1.0], [110, 0.0]])
    assert emane[1][1, 2] == [0.0, 1.0]  # down before its first pathloss
    assert emane[1][2, 1] == [0.0, 0.5]


MOVES = "0 0 0 4 40 0\n0 0 0\n0 0 30\n"  # the first leaves at 10 m/s


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        ({"model": "disk", "range": 15.0}, [1.0] * 4 + [0.0] * 4),
        ({"model": "ramp", "inner": 10.0, "outer": 30.0}, [1.0, 1.0, 1.0, 0.75, 0.5, 0.25, 0.0, 0.0]),
        ([[0.0, 1.0], [40.0, 0.0]], [1.0, 0.875, 0.75, 0.625, 0.5, 0.375, 0.25, 0.125]),
    ],
)
def test_positions_over_time_reach_by_distance(curve, expected, onto):
    ticks, worth, _ = onto(MOVES, curve=curve)
    held = np.array(worth[1, 2])[np.searchsorted(ticks, np.arange(8), side="right") - 1]
    np.testing.assert_allclose(held, expected, atol=1e-12)


def test_half_passes_at_the_range_of_a_log_distance(onto):
    still = "0 0 0\n0 20 0\n0 20 0\n"
    worth = onto(still, curve={"model": "log-distance", "range": 20.0})[1]
    assert worth[1, 2] == pytest.approx([0.5])
    assert worth[2, 3] == [1.0]  # in one place


@pytest.mark.parametrize(
    ("text", "meaning", "says"),
    [
        (MOVES, {}, "it says where nodes are: how far do they reach"),
        ("0 0 0\n0 0 0\n", {"curve": {"model": "disk", "range": 5.0}}, "it does not say where agent 3 is"),
        ("1\n2\n", {}, "a file of format mahimahi that says rate, and no availability: name one that does"),
        (CONTACTS, {"curve": [[0, 1], [1, 0]]}, "it says availability itself: leave out curve"),
        (CONTACTS, {"interval": 2.0}, "its times are in seconds: leave out interval"),
        ("time,src,dst,availability\n0,1,3,1\n", {}, "line 2: 1->3 is not a link of the formation"),
    ],
)
def test_what_a_file_does_not_say_is_asked_for(text, meaning, says, onto):
    with pytest.raises(MeasuredError, match=says) as caught:
        onto(text, **meaning)
    assert "\n" not in str(caught.value)
