"""Option strings of Linux `tc ... netem` -> a link profile in the plain form of a scenario file.

Read where affinet means the same, noted where netem's words mislead, refused where they do not do what they say
(linux:net/sched/sch_netem.c, iproute2:tc/q_netem.c). Probabilities in [0, 1], times in seconds, rates in bit/s.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from sys import float_info
from typing import Any, NamedTuple

Given = Mapping[str, list[str]]
Kind = tuple[Mapping[str, int], float, str]

_NUMBER = re.compile(r"([0-9]+(?:\.[0-9]+)?)([A-Za-z%]*)")
_BARE = "tc takes a bare number for microseconds, since iproute2 6.9 for nanoseconds"
# A kind of value: units as powers of ten (so 2.3ms is the number nearest to 0.0023), the largest, what to write.
_SHARE: Kind = ({"%": -2}, 1.0, "a percentage from 0% to 100%, such as 10% (tc takes a bare 0.1 for 0.1%)")
_TIME: Kind = (
    {"s": 0, "ms": -3, "us": -6, "ns": -9},
    float_info.max,
    f"a time in s, ms, us or ns, such as 10ms ({_BARE})",
)
_BITS = {"bit": 0, "kbit": 3, "mbit": 6, "gbit": 9, "tbit": 12}
_RATE: Kind = (_BITS, float_info.max, f"a rate in bits per second, such as 250kbit ({', '.join(_BITS)})")
_JITTERS = {"uniform": "half-width", "normal": "standard deviation", "pareto": "standard deviation"}
# Without its own, a chain's second probability is 1 minus the first, and the rest are these.
_CHAINS = {
    "state": ("markov", ("p13", "p31", "p32", "p23", "p14"), (0.0, 1.0, 0.0)),
    "gemodel": ("gilbert-elliott", ("p", "r", "bad", "good"), (1.0, 0.0)),
}
_ELSEWHERE = {
    "limit": "netem counts packets, affinet's queue is in bytes; leave it out and set rate.queue in bytes",
    "gap": "affinet reorders by chance, not by count; write `reorder P%` alone",
}


class Reading(NamedTuple):
    """A link profile in plain form, and warnings where netem's own words mislead."""

    profile: dict[str, Any]
    notes: tuple[str, ...]


class NetemTextError(ValueError):
    """What was wrong in which word of a netem text, and what would be right."""


def read(text: str) -> Reading:
    """The link profile that a netem option string describes, such as `delay 30ms 5ms loss gemodel 1% 10%`.

    Raises
    ------
    NetemTextError
        When a word is none that is read, lacks its unit, or asks for what netem itself does not do as it says.
    """
    given = _options(text.split())
    profile = {option: reader(given) for option, reader in _READERS.items() if option in given}
    _check_delay(given, profile.get("delay", {}))
    return Reading(profile, tuple(_notes(given, profile.get("loss", [{}])[0], profile.get("delay", {}))))


def _options(words: list[str]) -> dict[str, list[str]]:
    given: dict[str, list[str]] = {}
    for before, word in zip(["", *words], words, strict=False):
        if before in ("loss", "distribution") or (given and not word[0].isalpha()):
            given[list(given)[-1]].append(word)
        elif word not in (*_READERS, "distribution"):
            raise NetemTextError(f"{word!r}: {_ELSEWHERE.get(word, _READ)}")
        elif word in given:
            raise NetemTextError(f"{word!r}: given twice; give each option once")
        else:
            given[word] = []
    if not given:
        raise NetemTextError("'': nothing to read; write an option, such as `loss 10%`")
    return given


def _check_delay(given: Given, delay: Mapping[str, Any]) -> None:
    if "reorder" in given and not delay.get("mean"):
        raise NetemTextError("'reorder': only what is delayed can be overtaken; give a delay, such as `delay 10ms`")
    if "distribution" in given and not (delay.get("mean") and delay.get("jitter")):
        raise NetemTextError("'distribution': needs a delay and a jitter above zero; write `delay 10ms 2ms` with it")


def _loss(given: Given) -> list[dict[str, Any]]:
    words = given["loss"]
    model, values = (words[0], words[1:]) if words and words[0][0].isalpha() else ("random", words)
    if model == "random":
        return [_bernoulli(values)]
    if model not in _CHAINS:
        raise NetemTextError(f"{model!r}: not a loss model of netem; write loss random, state or gemodel")
    return [_chain(model, values)]


def _bernoulli(words: list[str]) -> dict[str, Any]:
    mean, *correlation = _values("loss", words, _SHARE, _SHARE)
    if not any(correlation):
        return {"model": "bernoulli", "p": mean}
    kept = correlation[0] if correlation[0] < 1.0 else 0.99  # at 1 the chain would never leave its first state
    p, r = mean * (1.0 - kept), (1.0 - mean) * (1.0 - kept)
    raise NetemTextError(
        f"{words[1]!r}: netem's correlated loss misses its share: its AR(1) blend of uniforms collapses the tail, so a "
        "small loss loses almost nothing (measured: 0.3% 25% loses none in 1.5 million, 10% 50% loses 0.11%); for mean "
        f"loss {_shown(mean)} in bursts of correlation {_shown(kept)} write `loss gemodel {_shown(p)} {_shown(r)}`"
    )


def _chain(name: str, words: list[str]) -> dict[str, Any]:
    model, names, defaults = _CHAINS[name]
    stated = _values(f"loss {name}", words, *[_SHARE] * len(names))
    values = [*stated, *(1.0 - stated[0], *defaults)[len(stated) - 1 :]]
    return {"model": model, **dict(zip(names, values, strict=True)), "step": "packet"}


def _delay(given: Given) -> dict[str, Any]:
    mean, *varying = _values("delay", given["delay"], _TIME, _TIME, _SHARE)
    if not varying:
        return {"model": "constant", "mean": mean}
    jitter, correlation = (*varying, 0.0)[:2]
    if correlation == 1.0:
        raise NetemTextError(f"{given['delay'][2]!r}: such a delay never changes; write a correlation below 100%")
    stated = {"model": _law(given), "mean": mean, "jitter": jitter}
    return {**stated, "correlation": correlation} if correlation else stated


def _law(given: Given) -> str:
    law = " ".join(given.get("distribution", ["uniform"]))
    if law not in _JITTERS:
        right = f'write {", ".join(_JITTERS)}, or give measured delays with model = "table"'
        raise NetemTextError(f"{law!r}: not a distribution that is read; {right}")
    return law


def _notes(given: Given, loss: Mapping[str, Any], delay: Mapping[str, Any]) -> Iterator[str]:
    if "step" in loss:
        yield 'step = "packet" as in netem: the chain freezes on an idle link; step = "time" steps with simulated time'
    if "jitter" in delay:
        stated = "distribution given" if "distribution" in given else "no distribution given"
        yield f"jitter is a {_JITTERS[delay['model']]} here ({stated})"
    if delay.get("model") == "uniform" and delay["jitter"] > delay["mean"]:
        yield "jitter is above the mean: delays below zero count as zero"
    if delay.get("model") == "pareto":
        yield "netem's pareto table has 0.82 of this jitter and ends 4 jitters above the mean; affinet's has it all"
    if "correlation" in delay:
        yield "affinet's correlation keeps the stated distribution exactly; netem's bends it, or hardly correlates"


def _share(option: str, given: Given) -> float:
    words = given[option]
    share, *correlation = _values(option, words, _SHARE, _SHARE)
    if any(correlation):
        raise NetemTextError(f"{words[1]!r}: netem's correlation changes the share; write `{option} {words[0]}`")
    return share


def _rate(given: Given) -> dict[str, float]:
    word = " ".join(given["rate"])
    unit = word.lower().lstrip("0123456789.")
    bits = unit.removesuffix("ps") + "it"
    if unit.endswith("bps") and bits in _BITS:
        raise NetemTextError(f"{word!r}: {unit} misleads, as tc counts bytes by it; write 8{bits} for 1{unit}")
    (rate,) = _values("rate", given["rate"], _RATE)
    if not rate:
        raise NetemTextError(f"{word!r}: expected a rate above zero; leave rate out for no limit")
    return {"rate": rate}


def _values(option: str, words: list[str], *kinds: Kind) -> list[float]:
    if not 1 <= len(words) <= len(kinds):
        raise NetemTextError(f"{option!r}: expected at least 1 value and at most {len(kinds)}, got {len(words)}")
    return [_value(word, kind) for word, kind in zip(words, kinds, strict=False)]


def _value(word: str, kind: Kind) -> float:
    exponents, most, right = kind
    match = _NUMBER.fullmatch(word)
    exponent = exponents.get(match[2].lower()) if match else None
    if match is None or exponent is None or (value := float(f"{match[1]}e{exponent}")) > most:
        raise NetemTextError(f"{word!r}: expected {right}")
    return value


def _shown(share: float) -> str:
    return f"{100.0 * share:.10f}".rstrip("0").rstrip(".") + "%"


_READERS: dict[str, Callable[[Given], Any]] = {
    "loss": _loss,
    "delay": _delay,
    "duplicate": partial(_share, "duplicate"),
    "corrupt": lambda given: [{"kind": "bit-flip", "p": _share("corrupt", given)}],
    "reorder": partial(_share, "reorder"),
    "rate": _rate,
}
_READ = f"not read; what is read: {', '.join(_READERS)}, distribution"
