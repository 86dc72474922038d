"""Lines of ping as iputils, BusyBox and macOS write them: `64 bytes from H: icmp_seq=1 ttl=64 time=4.1 ms`."""

from __future__ import annotations

import re

from affinet.traces.fields import number
from affinet.traces.ping_log import MOST, WIDEST, Log
from netem.impairments.measured import LONGEST, Lines, MeasuredError, shown

_HEADER = re.compile(r"^PING\s+(\S+)")
_FROM_ZERO = re.compile(r"^PING\s.*:\s\d+ data bytes")  # BusyBox and macOS count from 0, iputils from 1
_SEQUENCE = re.compile(r"\b(?:icmp_)?seq[= ](\d{1,18})")
_TOOK = re.compile(r"\btime([=<])([^\s=]+)\s+ms")
_STAMP = re.compile(r"^\[(\d{1,12}(?:\.\d{0,12})?)\]")
_SENT = re.compile(r"^(\d{1,18}) packets transmitted(?:, (\d+ (?:packets )?)received)?")
_ANSWER = re.compile(r"bytes from ")
_FOREIGN = re.compile(r"\bicmp_seq=\d{1,18} (?:ttl=|hlim=|.*\bms\b)")
_WRAP = 65536  # numbers of messages have 16 bits
_BACK = 8192  # so many numbers an answer comes late at most; it is of a later message otherwise
_LOOKED_AT = 20


class _Reading:
    """What was read, line by line."""

    def __init__(self) -> None:
        self.took: dict[int, float] = {}
        self.stamp: dict[int, float] = {}
        self.line: dict[int, int] = {}
        self.late = set[int]()
        self.doubled: dict[int, int] = {}
        self.target = ""
        self.from_zero: bool | None = None
        self.sent: tuple[int, int] | None = None  # line, and how many
        self.least = self.newest = 0
        self.any = False
        self._answered = -_WRAP

    def header(self, line: int, text: str, target: str) -> None:
        """Begin, once."""
        if self.target or self.any:
            raise MeasuredError(f"line {line}: another ping begins: give each a file of its own")
        self.target, self.from_zero = target, _FROM_ZERO.match(text) is not None

    def summary(self, line: int, said: re.Match[str]) -> None:
        """Take how many were sent."""
        sent = int(said[1])
        if sent > MOST:
            raise MeasuredError(f"line {line}: {sent} packets were transmitted: at most {MOST} are read")
        self.sent = line, sent
        if said[2] and self.from_zero is None:
            self.from_zero = "packets" in said[2]

    def message(self, line: int, text: str, said: str) -> None:
        """Take what became of a message."""
        if int(said) >= _WRAP:
            raise MeasuredError(f"line {line}: icmp_seq {shown(said)}: ping counts to {_WRAP - 1} and begins anew")
        this = self._counted_on(int(said))
        if not self.any:
            self.least = self.newest = this
        self.any, self.least, self.newest = True, min(self.least, this), max(self.newest, this)
        if self.newest - self.least >= MOST:
            raise MeasuredError(f"line {line}: more than {MOST} messages by its icmp_seq: cut the log into parts")
        if _ANSWER.search(text):
            self._answer(line, text, this)
        elif _FOREIGN.search(text):
            raise MeasuredError(
                f"line {line}: a ping in another language than English: log it by LC_ALL=C ping ...; got {shown(text)}"
            )

    def _counted_on(self, said: int) -> int:
        """The number of which the last 16 bits are said: a little before the newest, or after it."""
        if not self.any:
            return said
        begins = self.newest - _BACK
        if self.target:
            begins = max(begins, 0)
        return begins + (said - begins) % _WRAP

    def _answer(self, line: int, text: str, this: int) -> None:
        if "(DUP!)" in text:
            self.doubled[this] = self.doubled.get(this, 0) + 1
            return
        if this in self.took:
            raise MeasuredError(
                f"line {line}: icmp_seq {this % _WRAP} is answered again: give each ping a file of its own"
            )
        self.took[this] = _took(line, text)
        if this < self._answered:
            self.late.add(this)
        self._answered = max(self._answered, this)
        if at_time := _STAMP.match(text):
            self.stamp[this], self.line[this] = float(at_time[1]) - self.took[this] / 1000.0, line


def recognised(lines: Lines) -> bool:
    """Whether it is such a file, in whatever language."""
    return any(_HEADER.match(text) for text in lines.texts[:3]) or any(
        _SEQUENCE.search(text) and (_ANSWER.search(text) or "icmp_seq" in text) for text in lines.texts[:_LOOKED_AT]
    )


def read(lines: Lines) -> Log:
    """What a log says.

    Raises
    ------
    MeasuredError
        When it is none.
    """
    said = _Reading()
    for line, text in zip(lines.numbers, (text[:WIDEST] for text in lines.texts), strict=True):
        if header := _HEADER.match(text):
            said.header(line, text, header[1])
        elif summary := _SENT.match(text):
            said.summary(line, summary)
        elif at := _SEQUENCE.search(text):
            said.message(line, text, at[1])
    last_line = lines.numbers[-1] if lines.numbers else 1
    if not said.took:
        raise MeasuredError(f"line {last_line}: no answer in it, so no delay is known")
    if said.stamp and len(said.stamp) < len(said.took):
        raise MeasuredError(f"line {last_line}: only some answers have a time before them: use ping -D for all")
    first, of_begin = _first(said)
    last, of_end = _last(said)
    target = said.target or "there"
    return Log(said.took, said.stamp, said.line, said.late, said.doubled, first, last, target, (*of_begin, *of_end))


def _base(said: _Reading) -> int:
    """The number of the first message that ping sends."""
    return int(said.least != 0) if said.from_zero is None else int(not said.from_zero)


def _first(said: _Reading) -> tuple[int, list[str]]:
    """The first number that counts, and what is to be said of it."""
    base = _base(said)
    if said.least == base or (said.target and said.least < base):
        return said.least, []
    if said.target:
        before = f"{said.least - base} messages before icmp_seq {said.least % _WRAP}"
        return base, [f"it says nothing of the {before}: they count as lost"]
    begins = f"it begins at icmp_seq {said.least % _WRAP}"
    return said.least, [f"its first lines are not there: {begins}, what was lost before is not known"]


def _last(said: _Reading) -> tuple[int, list[str]]:
    """The last number that counts, and what is to be said of it."""
    if said.sent is None:
        return said.newest, ["its last lines are not there: what was lost after the last answer is not known"]
    line, sent = said.sent
    last = _base(said) + sent - 1
    if last < said.newest or sent < len(said.took):
        raise MeasuredError(
            f"line {line}: {sent} packets were transmitted, {len(said.took)} answered, and icmp_seq {said.newest % _WRAP} "
            "is among them: of which log is it?"
        )
    if not said.target:  # how often the numbers began anew before its first line is not known
        last -= (last - said.newest) // _WRAP * _WRAP
    return last, []


def _took(line: int, text: str) -> float:
    if (took := _TOOK.search(text)) is None:
        if _FOREIGN.search(text) and " ms" in text:
            raise MeasuredError(
                f"line {line}: no time=... ms in it: a ping in another language? log it by LC_ALL=C ping ...; "
                f"got {shown(text)}"
            )
        raise MeasuredError(f"line {line}: no time=... ms in it; ping with at least 16 bytes; got {shown(text)}")
    return number(line, took[2], "a round trip in ms", least=0.0, most=1000.0 * LONGEST)
