"""Logs of ping that are cut, or whose numbers wrap: what was lost is lost, and what the log does not say is a note."""

import numpy as np
import pytest

from affinet.traces import formats
from netem.impairments.measured import MeasuredError

HEADER = "PING b (10.0.0.2) 56(84) bytes of data.\n"
OF_BSD = "PING b (10.0.0.2): 56 data bytes\n"
FIRST_LINES, LAST_LINES = "its first lines are not there", "its last lines are not there"


@pytest.fixture
def read(tmp_path):
    def of(text):
        (tmp_path / "field.txt").write_text(text)
        return formats.read(tmp_path / "field.txt", None)[1]

    return of


def answers(*numbers):
    return "".join(f"64 bytes from 10.0.0.2: icmp_seq={n % 65536} ttl=64 time=4.0 ms\n" for n in numbers)


def sent(number, packets=""):
    return f"\n{number} packets transmitted, 1 {packets}received, 0% packet loss\n"


ROUND = 65536
SWAPPED = [*range(1, ROUND - 1), ROUND, ROUND - 1, ROUND + 1]
LOGS = {
    "cut at the beginning": (answers(5001, 5002, 5004), 4, [2], [f"{FIRST_LINES}: it begins at icmp_seq 5001", LAST_LINES]),
    "cut, and its end is there": (answers(5001, 5003) + sent(5005), 5, [1, 3, 4], [FIRST_LINES]),
    "cut, of BSD": (answers(5001, 5003) + sent(5005, "packets "), 4, [1, 3], [FIRST_LINES]),
    "cut after the numbers began anew": (answers(*range(4)) + sent(ROUND + 4), 5, [4], [FIRST_LINES]),
    "cut twice around": (answers(9, 10) + sent(2 * ROUND + 11), 3, [2], [FIRST_LINES]),
    "cut, late before 0": (answers(65534, 0, 65535, 1), 4, [], [FIRST_LINES, LAST_LINES]),
    "cut, late before its first line": (answers(1, 0, 65535) + sent(ROUND + 1), 3, [], [FIRST_LINES]),
    "no heading, all the same": (answers(1, 2), 2, [], [LAST_LINES]),
    "a whole round": (HEADER + answers(*range(1, 70000)) + sent(69999), 69999, [], []),
    "late where it wraps": (HEADER + answers(*SWAPPED) + sent(ROUND + 1), ROUND + 1, [], []),
    "the first are lost": (HEADER + answers(4, 5) + sent(5), 5, [0, 1, 2], ["nothing of the 3 messages before icmp_seq 4"]),
    "the first is lost, of BSD": (OF_BSD + answers(1, 2) + sent(3, "packets "), 3, [0], ["nothing of the 1 messages before"]),
}  # fmt: skip


@pytest.mark.parametrize(("text", "count", "lost", "notes"), LOGS.values(), ids=LOGS)
def test_what_is_lost_is_lost_and_what_is_not_known_is_a_note(text, count, lost, notes, read):
    """Before: what a log was cut of, and rounds of numbers, counted as outages, and nothing said so."""
    data = read(text)
    assert len(data.messages.lost) == count
    assert np.flatnonzero(data.messages.lost).tolist() == lost
    told = data.assumed[1:]
    assert len(told) == len(notes)
    assert all(note in one for note, one in zip(notes, told, strict=True))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (answers(5001) + sent(40), "line 3: 40 packets were transmitted, 1 answered, and icmp_seq 5001 is among them"),
        (HEADER + answers(*([1, 50000] * 200)), r"line \d+: more than 10000000 messages by its icmp_seq: cut the log"),
    ],
)
def test_numbers_that_cannot_be_are_refused(text, says, read):
    with pytest.raises(MeasuredError, match=says):
        read(text)


def test_answers_that_came_once_more(read):
    dup = "64 bytes from 10.0.0.2: icmp_seq=2 ttl=64 time=4.0 ms (DUP!)\n"
    assert read(HEADER + answers(1, 2) + 2 * dup + answers(3)).messages.doubled.tolist() == [0, 2, 0]


PINGING = "\nPinging b [10.0.0.2] with 32 bytes of data:\n"
STATISTICS = "\nPing statistics for 10.0.0.2:\n    Packets: Sent = {}, Received = 3, Lost = 1 (25% loss),\n"
STATISTICS += "Approximate round trip times in milli-seconds:\n    Minimum = 0ms, Maximum = 12ms, Average = 6ms\n"
OF_WINDOWS = (
    "Reply from 10.0.0.2: bytes=32 time=12ms TTL=64\nRequest timed out.\n"
    "Reply from 10.0.0.1: Destination host unreachable.\nReply from ::1: time<1ms\n"
)


def test_a_log_of_windows(read):
    data = read(PINGING + OF_WINDOWS + STATISTICS.format(4))
    assert data.nodes == ("here", "b")
    assert data.messages.lost.tolist() == [False, True, True, False]
    assert data.messages.delay[[0, 3]].tolist() == [0.006, 0.0005]
    assert data.paced
    assert any("waits for an answer" in note for note in data.assumed)
    assert any(FIRST_LINES in note for note in read(OF_WINDOWS + STATISTICS.format(99)).assumed)
    assert any(LAST_LINES in note for note in read(PINGING + OF_WINDOWS).assumed)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (PINGING + OF_WINDOWS + STATISTICS.format(5), "line 9: 5 packets were sent, and 4 lines tell of one"),
        (
            PINGING + OF_WINDOWS + "Antwort: keine.\n",
            "line 7: neither an answer of Windows' ping nor that there was none",
        ),
        (PINGING + OF_WINDOWS + PINGING, "line 8: another ping begins"),
        (PINGING + "Request timed out.\n", "line 3: no answer in it"),
        (PINGING + "Reply from b: bytes=32 time=99999999999ms TTL=4\n", "line 3: a round trip in ms is due, at most"),
    ],
)
def test_a_log_of_windows_that_is_wrong_says_where(text, says, read):
    with pytest.raises(MeasuredError, match=says):
        read(text)
