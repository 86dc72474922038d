"""Lines of ping as Windows writes them: `Reply from H: bytes=32 time=12ms TTL=64`, or `Request timed out.`, in their order."""

from __future__ import annotations

import re

from affinet.traces.fields import number
from affinet.traces.ping_log import MOST, WIDEST, Log
from netem.impairments.measured import LONGEST, Lines, MeasuredError, shown

_HEADER = re.compile(r"^Pinging\s+(\S+)")
_ANSWER = re.compile(r"^Reply from \S+:(?: bytes=\d+)? time([=<])(\d+)ms")
_SENT = re.compile(r"^\s*Packets: Sent = (\d{1,18}),")
_LOST = re.compile(
    r"^(?:Request timed out|General failure|PING: transmit failed|"
    r"(?:Reply from \S+: )?(?:Destination \w+ unreachable|TTL expired))",
    re.IGNORECASE,
)
_AROUND = re.compile(
    r"^(?:Ping statistics for|\s+Minimum =|Approximate round trip|\s+\[|with \d+ bytes|Control-|\^C|\S*>)"
)
_ANY_LANGUAGE = re.compile(r"[=<]\s?\d+\s?ms\s+TTL=\d+")
_LOOKED_AT = 20
_WAITS = (
    "it says no times, and waits for an answer for up to 4 s before it goes on: where many are lost it takes longer"
)
_WHOLE = "it tells whole milliseconds: what took less than 1 ms counts as 1 ms"


def recognised(lines: Lines) -> bool:
    """Whether it is such a file, in whatever language."""
    return any(
        _HEADER.match(text)
        or _ANSWER.match(text)
        or _ANY_LANGUAGE.search(text[:WIDEST])
        or text.startswith("Request timed out")
        for text in lines.texts[:_LOOKED_AT]
    )


def read(lines: Lines) -> Log:
    """What a log says: a line is a message.

    Raises
    ------
    MeasuredError
        When it is none.
    """
    took: dict[int, float] = {}
    count, target, sent, below = 0, "", None, False
    for line, text in zip(lines.numbers, (text[:WIDEST] for text in lines.texts), strict=True):
        if header := _HEADER.match(text):
            if target or count:
                raise MeasuredError(f"line {line}: another ping begins: give each a file of its own")
            target = header[1]
        elif answer := _ANSWER.match(text):
            took[count] = number(line, answer[2], "a round trip in ms", least=0.0, most=1000.0 * LONGEST)
            count += 1
        elif _LOST.match(text):
            count += 1
        elif summary := _SENT.match(text):
            sent = line, int(summary[1])
            below = True
        elif (target or count or _ANY_LANGUAGE.search(text)) and not (below or _AROUND.match(text)):
            raise MeasuredError(
                f"line {line}: neither an answer of Windows' ping nor that there was none: log it in English; "
                f"got {shown(text)}"
            )
    if not took:
        raise MeasuredError(f"line {lines.numbers[-1] if lines.numbers else 1}: no answer in it, so no delay is known")
    if count > MOST:
        raise MeasuredError(f"line {lines.numbers[-1]}: {count} messages: at most {MOST} are read")
    assumed = [_WAITS, _WHOLE]
    if sent is None:
        assumed.append("its last lines are not there: what was lost after the last answer is not known")
    elif sent[1] < count or (sent[1] > count and target):
        raise MeasuredError(
            f"line {sent[0]}: {sent[1]} packets were sent, and {count} lines tell of one: of which log?"
        )
    if not target:
        assumed.append("its first lines are not there: what was lost before is not known")
    return Log(took, {}, {}, set(), {}, 0, count - 1, target or "there", tuple(assumed))
