"""Each format of link data: a small file of its shape has the right numbers, and what is malformed says where."""

import json

import numpy as np
import pytest

from affinet.traces import formats
from affinet.traces.link_data import Quantity
from netem.impairments.measured import MeasuredError

AVAILABILITY, DELAY, RATE = Quantity.AVAILABILITY, Quantity.DELAY, Quantity.RATE


@pytest.fixture
def read(tmp_path):
    def of(text, name=None):
        (tmp_path / "field.txt").write_text(text)
        return formats.read(tmp_path / "field.txt", name)

    return of


def of_link(data, what, src, dst):
    """Times and values of a link, by the names of the file."""
    held = data.steps[what]
    rows = (held.src == data.nodes.index(src)) & (held.dst == data.nodes.index(dst))
    order = np.argsort(held.time[rows], kind="stable")
    return held.time[rows][order].tolist(), held.value[rows][order].tolist()


def answer(number, took, stamp="", more=""):
    return f"{stamp}64 bytes from 10.0.0.2: icmp_seq={number} ttl=64 time={took} ms{more}\n"


HEADER = "PING 10.0.0.2 (10.0.0.2) 56(84) bytes of data.\n"
SUMMARY = "\n--- 10.0.0.2 ping statistics ---\n8 packets transmitted, 5 received, 37.5% packet loss, time 7010ms\n"
# 1 and 3 in order, 2 after them, 5 twice; 4, 6 and 8 never
PING = HEADER + answer(1, 10.0) + answer(3, 14.0) + answer(2, 30.0) + answer(5, 8) + answer(5, 9, more=" (DUP!)")
PING += answer(7, 12.0) + SUMMARY


def test_ping(read):
    name, data = read(PING)
    said = data.messages
    assert (name, data.nodes, data.one_link, data.paced) == ("ping", ("here", "10.0.0.2"), True, True)
    assert said.lost.tolist() == [False, False, False, True, False, True, False, True]
    assert said.time.tolist() == list(range(8))
    np.testing.assert_allclose(said.delay[~said.lost], [0.005, 0.015, 0.007, 0.004, 0.006], atol=1e-12)
    assert said.late.tolist() == [False, True, False, False, False, False, False, False]
    assert said.doubled.tolist() == [0, 0, 0, 0, 1, 0, 0, 0]
    assert "half" in data.assumed[0]
    assert data.sent_every(0.2).messages.time.tolist() == pytest.approx([0.2 * n for n in range(8)])
    assert data.sent_every(0.2).ends == pytest.approx(1.6)


def test_ping_with_times(read):
    """The stamp is of the answer: a message was sent a round trip before it."""
    text = HEADER + answer(1, 500.0, "[1700000000.500000] ") + answer(4, 500.0, "[1700000003.500000] ")
    _, data = read(text)
    assert data.messages.time.tolist() == pytest.approx([0.0, 1.0, 2.0, 3.0])
    assert data.messages.lost.tolist() == [False, True, True, False]
    assert not data.paced
    assert any("last lines" in note for note in data.assumed)


def test_ping_of_other_systems_and_errors_of_the_way(read):
    _, data = read(
        "PING 10.0.0.2 (10.0.0.2): 56 data bytes\n64 bytes from 10.0.0.2: icmp_seq=0 ttl=56 time=14.1 ms\n"
        "Request timeout for icmp_seq 1\nFrom 10.0.0.1 icmp_seq=2 Destination Host Unreachable\n"
        "64 bytes from 10.0.0.2: seq=3 ttl=56 time=2.5 ms\n4 packets transmitted, 2 packets received\n"
    )
    assert data.messages.lost.tolist() == [False, True, True, False]
    _, data = read(HEADER + answer(65534, 1.0) + answer(65535, 1.0) + answer(0, 1.0) + answer(2, 1.0))
    assert data.messages.lost.tolist()[-4:] == [False, False, True, False]  # numbers have 16 bits


def udp(*intervals, **more):
    sums = [
        {"start": 1.0 * n, "end": n + 1.0, "seconds": 1.0, "bits_per_second": rate, "jitter_ms": 0.1, "lost_packets": lost,
         "packets": sent, "lost_percent": 0.0, "omitted": omitted, "sender": False}
        for n, (rate, sent, lost, omitted) in enumerate(intervals)
    ]  # fmt: skip
    said = {
        "start": {"connected": [{"socket": 5, "local_host": "10.0.0.1", "remote_host": "10.0.0.2"}]},
        "intervals": [{"streams": [], "sum": one} for one in sums],
        "end": {},
    }
    return json.dumps(said | more, indent="\t")


def test_iperf3_over_udp(read):
    name, data = read(udp((9e6, 100, 100, True), (1e6, 100, 10, False), (5e5, 200, 100, False), (0.0, 0, 0, False)))
    assert (name, data.nodes, data.ends) == ("iperf3", ("10.0.0.1", "10.0.0.2"), 3.0)
    assert of_link(data, AVAILABILITY, *data.nodes) == ([0.0, 1.0], [0.9, 0.5])  # of what was not sent nothing is known
    assert of_link(data, RATE, *data.nodes) == ([0.0, 1.0, 2.0], [1e6, 5e5, 0.0])
    assert data.messages is None
    assert any("omit" in note for note in data.assumed)


def test_iperf3_of_a_sender_has_what_the_server_saw(read):
    sender = json.loads(udp((1e6, 100, 0, False)))
    for one in sender["intervals"]:
        del one["sum"]["lost_packets"]
    _, alone = read(json.dumps(sender))
    assert AVAILABILITY not in alone.steps
    assert any("--get-server-output" in note for note in alone.assumed)
    _, both = read(json.dumps(sender | {"server_output_json": json.loads(udp((9e5, 100, 25, False)))}))
    assert of_link(both, AVAILABILITY, *both.nodes) == ([0.0], [0.75])


def test_iperf3_over_tcp(read):
    one = {"start": 0, "end": 1.0, "seconds": 1.0, "bytes": 125000, "bits_per_second": 1e6, "omitted": False}
    text = json.dumps({"intervals": [{"streams": [one | {"rtt": 30000, "retransmits": 3}], "sum": one}]})
    _, data = read(text)
    assert of_link(data, DELAY, "here", "there") == ([0.0], [0.015])
    assert of_link(data, RATE, "here", "there") == ([0.0], [1e6])
    assert AVAILABILITY not in data.steps


def test_mahimahi(read):
    name, data = read("1\n1\n3\n10\n")
    assert (name, data.period) == ("mahimahi", 0.01)
    time, rate = of_link(data, RATE, "here", "there")
    np.testing.assert_allclose(time, [0.0, 0.001, 0.002, 0.003, 0.009], atol=1e-12)
    assert rate == [24e6, 0.0, 12e6, 0.0, 12e6]
    lasts = np.diff([*time, 0.01])
    assert lasts @ rate == pytest.approx(4 * 12000)  # every opportunity is of 1500 bytes


MET = ([0.0, 2.0, 5.0, 8.0], [0.0, 1.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("one", "2.0\tCONN p1 p2 up\n3.0 C M1 1 2 500\n5 CONN 1 2 down\n8 CONN 1 2 UP\n9.5 DE M1 1 2\n"),
        ("contacts", "time one other state\n2.0 1 2 up\n5.0 1 2 down\n8 2 1 up\n"),
        ("contacts", "2.0,1,2,up\n5.0,1,2,down\n8,2,1,up\n"),
    ],
)
def test_contacts_are_up_and_down_both_ways(name, text, read):
    found, data = read(text)
    assert found == name
    assert of_link(data, AVAILABILITY, "1", "2") == of_link(data, AVAILABILITY, "2", "1") == MET
    assert data.everybody
    assert data.ends == (9.5 if name == "one" else 8.0)


def test_contacts_by_begin_and_end_that_overlap_are_one(read):
    name, data = read("1 2 2 4 1 0\n2 1 3 5 1 0\n1 2 8 9 2 3\n2 3 0 1 1 0\n")
    assert name == "intervals"
    assert of_link(data, AVAILABILITY, "1", "2") == ([0.0, 2.0, 5.0, 8.0, 9.0], [0.0, 1.0, 0.0, 1.0, 0.0])
    assert of_link(data, AVAILABILITY, "3", "2") == ([0.0, 1.0], [1.0, 0.0])
    assert of_link(data, AVAILABILITY, "1", "3") == ([0.0], [0.0])


def test_emane(read):
    name, data = read(
        "-10 nem:1 pathloss nem:2,90.5 nem:3,110,112\n0 nem:1 location gps 1,2,3\n2.5 nem:2 pathloss nem:1,120  # far\n"
    )
    assert name == "emane"
    assert of_link(data, Quantity.PATHLOSS, "1", "2") == ([0.0, 2.5], [90.5, 120.0])
    assert of_link(data, Quantity.PATHLOSS, "2", "1") == ([0.0, 2.5], [90.5, 120.0])
    assert of_link(data, Quantity.PATHLOSS, "1", "3") == ([0.0], [110.0])
    assert of_link(data, Quantity.PATHLOSS, "3", "1") == ([0.0], [112.0])
    assert any("location" in note for note in data.assumed)


SETDEST = """# nodes: 2
$node_(0) set X_ 0.0
$node_(0) set Y_ 0.0
$node_(0) set Z_ 0.0
$node_(1) set X_ 30.0
$node_(1) set Y_ 40.0
$god_ set-dist 0 1 1
$ns_ at 1.0 "$node_(0) setdest 30.0 40.0 10.0"
$ns_ at 3.0 "$node_(0) setdest 12.0 40.0 24.0"
"""


def test_setdest(read):
    """Turned after two seconds, at (12, 16), and there a second later."""
    name, data = read(SETDEST)
    assert (name, data.nodes, data.ends) == ("setdest", ("0", "1"), 4.0)
    way = data.paths[0]
    assert way.time.tolist() == [0.0, 1.0, 3.0, 4.0]
    np.testing.assert_allclose(way.position[:, :2], [[0, 0], [0, 0], [12, 16], [12, 40]], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "places"),
    [
        ("0 0 0 10 100 0\n0 5 5\n", [[0.0, 0.0], [100.0, 0.0]]),
        ("0 0 0 7 10 100 0 9\n0 5 5 5\n", [[0.0, 0.0, 7.0], [100.0, 0.0, 9.0]]),
    ],
)
def test_bonnmotion(text, places, read):
    name, data = read(text)
    assert (name, data.nodes) == ("bonnmotion", ("1", "2"))
    assert data.paths[0].time.tolist() == [0.0, 10.0]
    assert data.paths[0].position.tolist() == places


def test_a_table_of_several_quantities(read):
    name, data = read(
        "time,src,dst,availability,delay,rate\n0,uav1,ground,90 %,0.01,1e6\n1,uav1,ground,0,,\n2,uav1,ground,1,0.03,5e5\n"
    )
    assert (name, data.nodes) == ("table", ("uav1", "ground"))
    assert of_link(data, AVAILABILITY, "uav1", "ground") == ([0.0, 1.0, 2.0], [0.9, 0.0, 1.0])
    assert of_link(data, DELAY, "uav1", "ground") == ([0.0, 2.0], [0.01, 0.03])
    assert of_link(data, RATE, "uav1", "ground") == ([0.0, 2.0], [1e6, 5e5])


def without(text, what):
    changed = text.replace(what, "")
    assert changed != text
    return changed


WRONG = {
    "ping": [
        (HEADER + SUMMARY, "line 1|line 4: no answer in it"),
        (HEADER + "64 bytes from 10.0.0.2: icmp_seq=1 ttl=64\n", "line 2: no time=... ms in it; ping with at least 16"),
        (HEADER + answer(1, "fast"), "line 2: a number is due for a round trip in ms"),
        (PING + PING, "line 11: another ping begins: give each a file of its own"),
        (HEADER + answer(1, 1.0) + answer(1, 2.0), "line 3: icmp_seq 1 is answered again"),
        (HEADER + answer(70000, 1.0), "line 2: icmp_seq '70000': ping counts to 65535"),
        (HEADER + answer(1, 1.0) + "99999999999 packets transmitted\n", "line 3: 99999999999 packets were transmitted"),
        (HEADER + answer(1, 1.0) + answer(2, 1.0) + "1 packets transmitted, 1 received\n", "line 4: 1 packets were"),
        (HEADER + answer(1, 1.0, "[5.0] ") + answer(2, 1.0), "line 3: only some answers have a time .* use ping -D"),
        (HEADER + answer(1, 1.0, "[5.0] ") + answer(2, 1.0, "[4.0] "), "line 3: the times in brackets do not go up"),
        (HEADER + answer(1, 1e300), "line 2: a round trip in ms is due, at most 8.64e.07; got '1e.300'"),
        (HEADER + answer(1, -1.0), "line 2: a number is due for a round trip in ms, at least 0; got '-1.0'"),
        (HEADER + answer(1, "nan"), "line 2: a number is due for a round trip in ms, at least 0; got 'nan'"),
    ],
    "iperf3": [
        ('{"intervals": [\n{"sum": }]}', "line 2: no JSON: .*; write it by iperf3 --json"),
        ("[1, 2]", "line 1: iperf3 --json writes one object"),
        (json.dumps({"intervals": [], "error": "unable to connect"}), "iperf3 says 'unable to connect': run it again"),
        (udp(), "there is no interval in it: let iperf3 run for longer"),
        (udp((1e6, 10, 11, False)), "intervals.1.sum: 11 packets of 10 are lost"),
        (udp((1e6, 10, 0, False), ("much", 10, 0, False)), "intervals.2.sum.bits_per_second: a number is due, got 'much'"),
        (udp((1e6, 10, 0, True)), "all its intervals are omitted"),
        (json.dumps({"intervals": [{"streams": []}]}), "intervals.1: it has no sum"),
        (udp((1e6, 0, 0, False)), "no packet was sent in any interval"),
        (udp((1e300, 1, 0, False)), "intervals.1.sum.bits_per_second: a number is due, got '1e.300'"),
        (udp((10**400, 1, 0, False)), "intervals.1.sum.bits_per_second: a number is due, got '1000"),
        ('{"intervals": [' + "1" * 5000 + "]}", "line 1: no JSON: .*; write it by iperf3 --json"),
        (udp((float("nan"), 1, 0, False)), "intervals.1.sum.bits_per_second: a number is due, got 'nan'"),
    ],
    "mahimahi": [
        ("1\n2.5\n", "line 2: a whole number of milliseconds is due, got '2.5'"),
        ("1\n-3\n", "line 2: a whole number of milliseconds is due"),
        ("5\n4\n", "line 2: 4 ms comes after 5 ms: sort the lines"),
        ("0\n0\n", "line 1: the trace must last for longer than 0 ms"),
        ("", "line 1: the trace must last"),
        ("1\n" + "9" * 30 + "\n", "line 2: a whole number of milliseconds"),
    ],
    "one": [
        ("soon CONN 1 2 up\n", "line 1: a number is due for a time in s, at least 0; got 'soon'"),
        ("1 CONN 1 2\n", "line 1: an event like '12.5 CONN 3 4 up' is due"),
        ("1 CONN 1 2 up\n2 MEET 1 2 up\n", "line 2: an event like"),
        ("1 CONN 1 2 up\n0.5 CONN 1 3 up\n", "line 2: 0.5 s comes after 1 s: sort the lines by time"),
        ("1 CONN 1 2 down\n", "line 1: 1 and 2 go down and were not up: a line is missing"),
        ("1 CONN a1b 2 up\n", "line 1: a host is a number, with letters before it at most"),
        ("1 C M1 1 2 5\n", "nobody ever meets in it"),
        ("1e300 CONN 1 2 up\n", "line 1: a time in s is due, at most 1e.11; got '1e300': is its unit another"),
        ("1 CONN " + "1" * 5000 + " 2 up\n", "line 1: a host is a number"),
    ],
    "contacts": [
        ("1 1 2 open\n", "line 1: 'time one other up', or down, is due"),
        ("1 1 2\n", "line 1: 'time one other up', or down, is due"),
        ("-1 1 2 up\n", "line 1: a number is due for a time in s, at least 0"),
        ("1 2 2 up\n", "line 1: 2 meets itself: two nodes are due"),
        ("1 1 2 up\n2 2 1 up\n", "line 2: 1 and 2 go up and were up already"),
        ("time one other state\n", "nobody ever meets in it"),
        ("1700000000000 1 2 up\n", "line 1: a time in s is due, at most 1e.11; got '1700000000000': is its unit another"),
        ("1 1 01 up\n", "line 1: 1 meets itself"),
        ("".join(f"{n} 0 {n} up\n" for n in range(1, 2000)), "line 1000: more than 1000 nodes: leave out those that"),
    ],
    "intervals": [
        ("1 2 3\n", "line 1: 'one other begin end' is due"),
        ("1 2 0 x\n", "line 1: a number is due for the end of a contact"),
        ("1 2 -1 4\n", "line 1: a number is due for the begin of a contact in s, at least 0"),
        ("1 2 0 4\n1 2 5 4\n", "line 2: the contact ends at 4 s, before it begins at 5 s"),
        ("1 1 0 4\n", "line 1: 1 meets itself"),
        ("1 2 3 3\n", "nobody ever meets in it"),
        ("1 2 3 1e300\n", "line 1: the end of a contact in s is due, at most 1e.11"),
        ("1 1.0 0 4\n", "line 1: 1 meets itself"),
    ],
    "emane": [
        ("0 nem:1\n", "line 1: 'TIME nem:N pathloss nem:M,dB' is due"),
        ("0 nem:1 pathloss nem:2\n", "line 1: nem:M,dB or nem:M,dB,dB back is due, got 'nem:2'"),
        ("0 nem:1 pathloss 2,90\n", "line 1: an NEM is due, like nem:3, got '2'"),
        ("0 nem:1 pathloss nem:2,far\n", "line 1: a number is due for a pathloss in dB"),
        ("0 nem:1 pathloss nem:1,90\n", "line 1: nem:1 has a pathloss to itself"),
        ("0 nem:1 pathloss nem:2,90\n0 nem:2 pathloss nem:1,91\n", "line 2: .* has two values at 0 s"),
        ("0 nem:1 location gps 1,2,3\n", "no event of pathloss in it"),
        ("0 nem:1 pathloss\n", "line 1: nobody is told the pathloss of nem:1"),
        ("0 nem:1 pathloss nem:2,1e300\n", "line 1: a pathloss in dB is due, at most 1000"),
        ("0 nem:" + "1" * 5000 + " pathloss nem:2,9\n", "line 1: an NEM is due"),
    ],
    "setdest": [
        ('$ns_ at 1.0 "$node_(0) setdest 1 2 3"\n', "line 1: node 0 moves and has no place at first"),
        (SETDEST + '$ns_ at 4 "$node_(0) setdest 1 2"\n', "line 10: setdest takes X, Y and a speed, got '1 2'"),
        (SETDEST + '$ns_ at 4 "$node_(0) setdest 1 2 -3"\n', "line 10: a number is due for a speed in m/s, at least 0"),
        (SETDEST + "$node_(0) goes away\n", "line 10: .* is due, got"),
        (SETDEST + '$ns_ at 4 "$node_(0) set X_ 3"\n', "line 10: a node that jumps"),
        (without(SETDEST, "$node_(1) set Y_ 40.0\n"), "node 1 has no Y_ at first: set it"),
        ("$node_(0) set X_ here\n", "line 1: a number is due for X_ in m"),
        ("$node_(0) set X_ 1e300\n", "line 1: X_ in m is due, at most 1e.09"),
        (SETDEST + '$ns_ at 9 "$node_(0) setdest 1 2 1e-300"\n', "line 10: at 1e-300 m/s the way takes .* give a higher speed"),
        (SETDEST + '$ns_ at 4 "$node_(0) setdest ' + " " * 200_000 + "\n", "line 10: .* is due, got"),
        ("$node_(0) set X_ 1\n$node_(0) set Y_ 1\n", "line 1: one node in it, and no link"),
    ],
    "bonnmotion": [
        ("0 0 0\n0 0\n", r"line 2: 2 numbers are no whole triples \(t x y\), nor t x y z"),
        ("0 0 zero\n", "line 1: only numbers are due"),
        ("5 0 0 4 0 0\n", "line 1: its times do not go up"),
        ("0 0 0\n0 0 0 0\n", "some lines are t x y and others t x y z: make them alike"),
        ("0 0 inf\n", "line 1: only numbers are due"),
        ("0 0 1e300\n0 0 0\n", "line 1: a place 1e.300 m away: at most 1e.09 m"),
        ("0 0 0\n1e300 0 0\n", "line 2: a time of 1e.300 s: at most 1e.11 s"),
        ("0 0 0\n" * 2000, "line 1001: more than 1000 nodes: leave out"),
        ("0 0 0 1 5 5\n", "line 1: one node in it, and no link: give the ways of two"),
        ("", "line 1: no node in it"),
    ],
    "table": [
        ("time,src,dst,rssi\n0,1,2,strong\n", "line 2: four numbers are due"),
        ("time,src,dst,delay\n0,1,2,-1\n", "line 2: time must be at least 0 s, and delay at least 0 s"),
        ("time,src,dst,rate\n0,1,2,inf\n", "line 2: .* rate at least 0 bit/s"),
        ("time,src,dst,rate\n0,1,2,5 %\n", "line 2: four numbers are due"),
        ("time,src,dst,pathloss\n0,1,2,nan\n", "line 2: .* pathloss a number, in dB"),
        ("time,src,dst,rssi\n0,1,2,-60\n0,1,2,-70\n", "line 3: 1->2 has two values at 0 s"),
        ("time,src,dst\n0,1,2\n", "line 1: the columns must be"),
        ("time,src,dst,delay\n0,1,2,1e300\n", "line 2: delay is 1e.300 s: at most 86400 s; is its unit another"),
        ("time,src,dst,delay,rate\n0,1,2,nan,1\n", "line 2: .* delay at least 0 s"),
        ("time,src,dst,delay,rate\n0,1,2,,1\n0,2,1,nan,1\n", "line 3: .* delay at least 0 s"),
        ("time,src,dst,delay,rate\n0,1,2,-1,1\n", "line 2: .* delay at least 0 s"),
        ("time,src,dst,rate\n0,1,2,1e300\n", "line 2: rate is 1e.300 bit/s: at most 1e.15 bit/s"),
        ("time,src,dst,rssi\n0,1,2,-1e300\n", "line 2: rssi is -1e.300 dBm: at most 1000 dBm"),
        ("time,src,dst,distance\n0,1,2,1e300\n", "line 2: distance is 1e.300 m: at most 1e.09 m"),
        ("time,src,dst,delay\n1e300,1,2,1\n", "line 2: time is 1e.300 s: at most 1e.11 s"),
        ("time,src,dst,delay\n0,1,1,1\n", "line 2: 1->1 is not a link: two nodes are due"),
        ("time,src,dst,delay\n0,b,a,1\n0,a,a,1\n", "line 3: a->a is not a link"),
        ("# mine\ntime,src,dst,delay\n\n", "line 2: a heading and no row below it"),
        ("time,src,dst,delay,rate\n0,1,2,,\n0,2,1,,\n", "line 2: no value of delay, rate here or below"),
    ],
}  # fmt: skip


@pytest.mark.parametrize(("name", "text", "says"), [(name, *one) for name, every in WRONG.items() for one in every])
def test_what_is_malformed_says_where_and_the_way_out(name, text, says, read):
    with pytest.raises(MeasuredError, match=says) as caught:
        read(text, name)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 250


def test_every_format_has_at_least_five_malformed_files():
    assert WRONG.keys() == formats.FORMATS.keys()
    assert all(len(every) >= 5 for every in WRONG.values())


def test_a_file_of_two_formats_wants_to_be_told(read):
    text = "1 2 3 4\n1 3 5 6\n"
    with pytest.raises(MeasuredError, match=r"it could be of format intervals or bonnmotion: say which, by --format"):
        read(text)
    assert read(text, "intervals")[1].nodes == ("1", "2", "3")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1 2 5 4\n2 3 9 8\n", "line 1: the contact ends at 4 s, before it begins at 5 s"),
        ("1 2 0 4\n3 4 5 4\n", "line 2: the contact ends at 4 s, before it begins at 5 s"),
        (
            "1 2 0 4\n1 2 5 4\n",
            "of format intervals or bonnmotion: .*as intervals it is wrong in line 2: the contact ends",
        ),
        ("1 2 5 4 0 0\n", "of format intervals or bonnmotion: .*as intervals it is wrong in line 1: the contact ends"),
        ("1 2 5 4 0\n", "line 1: the contact ends"),
        ("1 1 0 4 0\n1 2 0 4 0\n", "line 1: 1 meets itself"),
        ("0,1,2,0.9\n0.05,1,2,0.5\n", "line 1: the columns must be time,src,dst"),  # a table without its heading
        ("0 1 2 0.9\n0.05 1 2 0.5\n", "line 1: of no format that is known: '0 1 2 0.9'"),
        ("1 1 2 up\n2 1 2 open\n", "line 2: 'time one other up', or down, is due"),
        ("1 2 up\n1 1 2 up\n", "line 1: 'time one other up', or down, is due"),
        ("1\n2\nx\n", "line 1: of no format that is known: '1'; say which"),
        ("0 0 0 1 5 5\n0 0 0 1 x 5\n", "line 1: of no format that is known"),
    ],
)
def test_a_format_is_not_guessed_from_lines_that_contradict_another(text, says, read):
    """Before: contacts of which one ends before it begins, and tables without a heading, were movements."""
    with pytest.raises(MeasuredError, match=says):
        read(text)


def test_a_file_of_no_format_says_what_a_table_is(read):
    with pytest.raises(MeasuredError, match="line 1: the columns must be time,src,dst and one or more of"):
        read("hello, world\n")
    with pytest.raises(
        MeasuredError, match=r"line 1: of no format that is known: 'hello'; say which, as its format.*ping"
    ):
        read("hello\n")


@pytest.mark.parametrize(
    ("text", "name", "says"),
    [
        (
            json.dumps({"start": {}, "error": "unable to connect"}),
            "iperf3",
            "iperf3 says 'unable to connect': run it again",
        ),
        (json.dumps({"error": "interrupt - the server has terminated", "intervals": []}), "iperf3", "the test failed"),
        ("Connecting to host b, port 5201\n[ ID] Interval\n", "iperf3", "line 1: .* write it by iperf3 --json"),
        ("[ ID] Interval           Transfer     Bitrate\n", "iperf3", "line 1: .* write it by iperf3 --json"),
        ("64 Bytes von b: icmp_seq=1 ttl=64 Zeit=0.03 ms\n", "ping", "line 1: .* LC_ALL=C ping"),
        (HEADER + "64 octets de b : icmp_seq=1 ttl=64 temps=0.03 ms\n", "ping", "line 2: .* LC_ALL=C ping"),
        (HEADER + "64 bytes desde b: icmp_seq=1 ttl=64 tiempo=0.03 ms\n", "ping", "line 2: .* LC_ALL=C ping"),
        ("64 bytes from b: icmp_seq=1 ttl=64 Zeit=0.03 ms\n", "ping", "line 1: .* LC_ALL=C ping"),
        ("64 字节，来自 b: icmp_seq=1 ttl=64 时间=0.030 毫秒\n", "ping", "line 1: .* LC_ALL=C ping"),
        (
            "Ping für b mit 32 Bytes:\nAntwort von b: Bytes=32 Zeit=12ms TTL=64\n",
            "ping",
            "line 2: .* log it in English",
        ),
    ],
)
def test_what_a_tool_says_otherwise_is_known_and_the_way_out_is_its_own(text, name, says, read):
    """Before: all of them were bad tables."""
    for told in (None, name):
        with pytest.raises(MeasuredError, match=says) as caught:
            read(text, told)
        assert "columns" not in str(caught.value)


def test_a_column_without_a_value_says_nothing(read):
    _, data = read("time,src,dst,availability,delay\n0,1,2,1,\n0,2,1,0.5,\n")
    assert data.steps.keys() == {AVAILABILITY}
    assert data.assumed == ("it has a column of delay and no value in it: it says nothing of that",)


def test_large_numbers_of_nodes_are_told_apart(read):
    """Before: 1234567 and 1234568 were both 1.23457e+06."""
    for rows in ("0,1234567,1234568,1\n", "0,1234567,1234568,1\n0,a,b,1\n"):
        assert read(f"time,src,dst,availability\n{rows}")[1].nodes[:2] == ("1234567", "1234568")
