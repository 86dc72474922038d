"""Files that are known to be what was written: what is kept of finished work has its digest behind it."""

from __future__ import annotations

import hashlib

_SEAL = hashlib.sha256().digest_size


def sealed(packed: bytes) -> bytes:
    """What is written for it."""
    return packed + hashlib.sha256(packed).digest()


def opened(written: bytes) -> bytes | None:
    """What was sealed; nothing if it is no longer what it was."""
    packed = written[:-_SEAL]
    return packed if packed and sealed(packed) == written else None
