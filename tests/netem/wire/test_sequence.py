"""Sequence numbers notice a loss or a repeat that nobody ordered, and forgive a restart."""

import pytest

from netem.wire.sequence import Numbering, Sequences, UninstructedLoss


def test_each_stream_is_numbered_from_0():
    numbers = Numbering()
    assert [numbers.next("a"), numbers.next("a"), numbers.next("b"), numbers.next("a")] == [0, 1, 0, 2]


def test_a_restarted_numbering_begins_again_for_that_stream_alone():
    numbers = Numbering()
    for stream in ("a", "a", "b"):
        numbers.next(stream)
    numbers.restart("a")
    assert (numbers.next("a"), numbers.next("b")) == (0, 1)


def test_a_whole_stream_passes():
    sequences = Sequences("agent")
    for number in range(5):
        sequences.check("3 theta", number)


def test_streams_are_checked_apart():
    sequences = Sequences("agent")
    for stream, number in (("3 theta", 0), ("4 theta", 0), ("3 theta", 1), ("3 input", 0)):
        sequences.check(stream, number)


def test_a_gap_is_noticed_and_names_the_stream_and_how_many_are_gone():
    sequences = Sequences("agent")
    sequences.check("3 theta", 0)
    with pytest.raises(
        UninstructedLoss, match=r"agent 3 theta: message 4 came where 1 was due.* 3 that nobody ordered"
    ):
        sequences.check("3 theta", 4)


def test_a_stream_that_lost_its_first_message_is_noticed():
    with pytest.raises(UninstructedLoss, match="world sense: message 1 came where 0 was due"):
        Sequences("world").check("sense", 1)


def test_a_repeat_is_noticed():
    sequences = Sequences("agent")
    sequences.check("3 theta", 0)
    with pytest.raises(UninstructedLoss, match="message 0 came where 1 was due"):
        sequences.check("3 theta", 0)


def test_two_messages_out_of_order_are_noticed():
    sequences = Sequences("agent")
    sequences.check("3 theta", 0)
    with pytest.raises(UninstructedLoss, match="message 2 came where 1 was due"):
        sequences.check("3 theta", 2)


def test_after_a_restart_0_is_due():
    sequences = Sequences("agent")
    for number in range(3):
        sequences.check("3 theta", number)
    sequences.restart("3 theta")
    sequences.check("3 theta", 0)
    sequences.check("3 theta", 1)


def test_after_a_restart_the_old_numbers_are_noticed():
    sequences = Sequences("agent")
    sequences.check("3 theta", 0)
    sequences.restart("3 theta")
    with pytest.raises(UninstructedLoss, match="message 1 came where 0 was due"):
        sequences.check("3 theta", 1)


def test_a_restart_of_one_stream_leaves_the_others():
    sequences = Sequences("agent")
    sequences.check("3 theta", 0)
    sequences.check("4 theta", 0)
    sequences.restart("3 theta")
    sequences.check("4 theta", 1)


def counting(said):
    sequences, lost = Sequences("agent", lost=lambda stream, number: lost.append((stream, number))), []
    for number in said:
        if number is None:
            sequences.refuse("3 theta")
        else:
            sequences.check("3 theta", number)
    return lost


@pytest.mark.parametrize(
    ("said", "lost"),
    [
        ((0, 1, 2), []),
        ((0, 3), [2]),
        ((0, None, 2, 3), []),
        ((0, None, None, 3), []),
        ((0, None, 4), [2]),
        ((0, None, 1, 3), [1]),
        ((None, 1, None, 3), []),
    ],
    ids=str,
)
def test_where_nobody_waits_what_was_refused_is_not_lost_by_the_transport(said, lost):
    assert counting(said) == [("3 theta", number) for number in lost]


def test_what_was_refused_of_a_process_that_is_gone_hides_no_loss():
    lost = []
    sequences = Sequences("agent", lost=lambda stream, number: lost.append((stream, number)))
    sequences.refuse("3 theta")
    sequences.restart("3 theta")
    sequences.check("3 theta", 1)
    assert lost == [("3 theta", 1)]
