"""Sequence numbers: how a loss that nobody ordered is noticed."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable

from netem.wire.wrong import Wrong


class UninstructedLoss(RuntimeError):
    """A message vanished that no fault and no profile had dropped, or one came twice.

    Parameters
    ----------
    says
        Which.
    wrong
        Which of both.
    """

    def __init__(self, says: str, wrong: Wrong) -> None:
        super().__init__(says)
        self.wrong = wrong


class Numbering:
    """Gives each stream its next number, from 0."""

    def __init__(self) -> None:
        self._next: defaultdict[str, int] = defaultdict(int)

    def due(self, stream: str) -> int:
        """The number that would be next."""
        return self._next[stream]

    def next(self, stream: str) -> int:
        """The number of the message about to be sent."""
        number = self._next[stream]
        self._next[stream] = number + 1
        return number

    def skip(self, stream: str, number: int) -> None:
        """Go on at this number."""
        self._next[stream] = number

    def join(self, stream: str, number: int) -> None:
        """Begin at this number, where the stream has none yet."""
        self._next.setdefault(stream, number)

    def restart(self, stream: str) -> None:
        """Begin again at 0: the other end is a new process."""
        self._next[stream] = 0


class Sequences:
    """Checks that each stream from one kind of sender arrives whole and in order.

    Parameters
    ----------
    sender
        Whose streams they are.
    from_any
        Whether the first message of a stream may have any number: it began before anybody heard it.
    lost
        Told of a stream, and how many of its messages are missing, if that is no reason to refuse the next one: nobody waits
        for them.
    """

    def __init__(self, sender: str, *, from_any: bool = False, lost: Callable[[str, int], None] | None = None) -> None:
        self._sender, self._from_any, self._lost = sender, from_any, lost
        self._expected = Numbering()
        self._refused: Counter[str] = Counter()

    def refuse(self, stream: str) -> None:
        """Its latest message was refused before its number was looked at: the transport has not lost it."""
        self._refused[stream] += 1

    def check(self, stream: str, number: int) -> None:
        """Take note of a message; of one that is not the next, no note is taken.

        Raises
        ------
        UninstructedLoss
            When it is not the next one of its stream.
        """
        if self._from_any:
            self._expected.join(stream, number)
        expected = self._expected.due(stream)
        if self._lost is not None and number > expected:
            if (lost := number - expected - self._refused[stream]) > 0:
                self._lost(stream, lost)
            self._expected.skip(stream, number)
            expected = number
        if number != expected:
            raise UninstructedLoss(
                f"{self._sender} {stream}: message {number} came where {expected} was due; "
                f"the transport lost or doubled {abs(number - expected)} that nobody ordered",
                Wrong.SKIPPED if number > expected else Wrong.REPEATED,
            )
        self._expected.next(stream)
        self._refused.pop(stream, None)

    def restart(self, stream: str) -> None:
        """Expect 0 again: the sender is a new process."""
        self._expected.restart(stream)
        self._refused.pop(stream, None)
