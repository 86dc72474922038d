"""Bytes, texts and plain values as they might be but should not: what a fuzzer makes of a right one."""

from random import Random
from typing import Any

import msgpack

NUMBERS = (0, 1, -1, 2, 7, 127, 128, 255, 2**31, 2**32, 2**53 + 1, 2**63 - 1, 2**63, 2**64 - 1, -(2**31), -(2**63))
NUMBERS_WITH_POINT = (
    0.0,
    -0.0,
    0.5,
    -1.5,
    1e6,
    1e150,
    1e155,
    1e308,
    -1e308,
    5e-324,
    float("nan"),
    float("inf"),
    float("-inf"),
)
ODD = (
    None,
    True,
    False,
    "",
    "yes",
    "1",
    "\0",
    "é" * 40,
    b"",
    b"\0",
    b"\1\2",
    bytes(8),
    bytes(16),
    bytes(24),
    bytes(32),
    bytes(48),
)
LONGEST = 40


def of_bytes(random: Random, data: bytes) -> bytes:
    """Bytes with something flipped, cut out, doubled, put in, or cut off, a few times."""
    changed = bytearray(data)
    for _ in range(random.randint(1, 4)):
        at = random.randrange(len(changed) + 1)
        upto = min(len(changed), at + random.randint(0, 12))
        match random.randrange(7):
            case 0 if at < len(changed):
                changed[at] ^= 1 << random.randrange(8)
            case 1 if at < len(changed):
                changed[at] = random.choice((0, 0x7F, 0x80, 0x90, 0xC0, 0xC1, 0xCB, 0xCF, 0xDD, 0xDF, 0xFF))
            case 2:
                del changed[at:upto]
            case 3:
                changed[at:at] = changed[at:upto] * random.randint(1, 3)
            case 4:
                changed[at:at] = random.randbytes(random.randint(1, 9))
            case 5:
                del changed[at:]
            case _:
                changed[at:upto] = random.randbytes(upto - at)
    return bytes(changed)


def of_plain(random: Random, plain: Any) -> Any:
    """A plain value with another value somewhere in it, or one too many, or too few."""
    if isinstance(plain, dict) and plain and random.random() < 0.85:
        name = random.choice([*plain])
        match random.randrange(12):
            case 0:
                return {key: value for key, value in plain.items() if key != name}
            case 1:
                return plain | {random.choice(("k", "src", "colour", "", "x" * LONGEST)): value(random)}
            case _:
                return plain | {name: of_plain(random, plain[name])}
    if isinstance(plain, list) and plain and random.random() < 0.7:
        at = random.randrange(len(plain))
        match random.randrange(6):
            case 0:
                return plain[:at] + plain[at + 1 :]
            case 1:
                return plain[:at] + plain[at : at + 1] * random.randint(2, 4) + plain[at + 1 :]
            case _:
                return [*plain[:at], of_plain(random, plain[at]), *plain[at + 1 :]]
    if isinstance(plain, bytes) and random.random() < 0.5:
        return of_bytes(random, plain)
    return value(random)


def value(random: Random, depth: int = 0) -> Any:
    """Any plain value."""
    match random.randrange(8 if depth < 4 else 5):
        case 0:
            return random.choice(NUMBERS)
        case 1:
            return random.choice(NUMBERS_WITH_POINT)
        case 2:
            return random.choice(ODD)
        case 3:
            return random.randint(-3, 9)
        case 4:
            return random.uniform(-10.0, 10.0)
        case 5 | 6:
            return [value(random, depth + 1) for _ in range(random.randrange(4))]
        case _:
            return {
                random.choice(("k", "x", "", "velocity")): value(random, depth + 1) for _ in range(random.randrange(3))
            }


def packed(random: Random, plain: Any) -> bytes:
    """A message that is wrong somewhere, as MessagePack: in its values, in its bytes, or in both; rarely in nothing."""
    match random.randrange(20):
        case 0:
            return random.randbytes(random.randrange(60))
        case 1:
            return msgpack.packb(plain)
        case 2:
            return msgpack.packb(plain)[:-1] + b"\x91" * random.choice((30, 600, 3000)) + b"\x90"
        case n if n < 9:
            return of_bytes(random, msgpack.packb(plain))
        case n if n < 18:
            return msgpack.packb(of_plain(random, plain))
        case _:
            return of_bytes(random, msgpack.packb(of_plain(random, plain)))
