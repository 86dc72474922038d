"""A folder of files that is written whole, or is gone when what fills it fails."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def new(path: Path) -> Iterator[Path]:
    """The folder, to fill in the block.

    Raises
    ------
    FileExistsError
        When it is there already.
    OSError
        When it cannot be made.
    """
    path.mkdir()
    try:
        yield path
    except BaseException:
        shutil.rmtree(path)
        raise
