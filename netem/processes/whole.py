"""Files that are written whole or not at all, at whatever moment the process that writes them ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A file beside this one, to write in the block; at its end it takes this one's place, or is gone if the block fails."""
    unfinished = path.with_suffix(f".unfinished{path.suffix}")
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
