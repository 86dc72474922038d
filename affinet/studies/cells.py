"""Finished cells of a study, kept in its directory while it flies: one that ended in between goes on from them.

A cell is a piece of the study: some runs of one of its cases. It is written under another name, and gets its own once it is
whole and on the disk; it says of what study it is, and ends with a digest of all before. One that is not whole all the same
flies anew. Who flies into the directory holds it as long as it lives.
"""

from __future__ import annotations

import fcntl
import io
import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa

from affinet.studies.batch import Runs
from affinet.studies.identity import Identity, differences
from affinet.studies.sealed import opened, sealed
from affinet.studies.sharing import Piece
from analysis.metrics.indicator import Bounds
from analysis.models.arrays import Array
from netem.processes.system_errors import about

FOLDER = "cells"  # in the directory of a study that is not done
_DONE = "cells-done"
_ENDING, _UNFINISHED = ".cell", ".part"
_COMPRESSION = "zstd"


@dataclass
class Cells:
    """The finished cells of a study.

    Parameters
    ----------
    folder, of
        In which they are kept, and of what they are.
    there
        Those that were kept when the study went on, with what came of them.

    Attributes
    ----------
    runs
        How many runs are kept by now.
    """

    folder: Path
    of: Identity
    there: dict[Piece, Runs] = field(default_factory=dict)
    runs: int = field(init=False)

    def __post_init__(self) -> None:
        self.runs = sum(len(piece.runs) for piece in self.there)

    def keep(self, piece: Piece, runs: Runs) -> None:
        """Keep what came of a piece: it is on the disk when this returns."""
        file = self.folder / f"{piece.case}-{piece.runs.start}-{piece.runs.stop}{_ENDING}"
        written = file.with_suffix(_UNFINISHED)
        with about(written), written.open("wb") as cell:
            cell.write(sealed(_packed(self.of, piece, runs)))
            cell.flush()
            os.fsync(cell.fileno())
        written.rename(file)
        _to_disk(self.folder)
        self.runs += len(piece.runs)

    def clear(self) -> None:
        """Let go of them all: what they were kept for is on the disk."""
        for left in self.folder.parent.iterdir():
            if left.is_file():
                _to_disk(left)
        _to_disk(self.folder.parent)
        done = self.folder.with_name(_DONE)
        self.folder.rename(done)  # half of them would look like a study that was interrupted
        shutil.rmtree(done)


def unfinished(out: Path) -> bool:
    """Whether a directory has cells of a study that is not done."""
    return (out / FOLDER).exists()


@contextmanager
def held(out: Path, of: Identity, says: Callable[[str], None]) -> Iterator[Cells]:
    """The cells in the directory of a study, which nobody else flies into meanwhile.

    Parameters
    ----------
    out, of
        The directory, and the identity of the cells that are to fly.
    says
        Told of each cell that is not whole, and flies anew.

    Raises
    ------
    FileExistsError
        When others are there, or somebody flies into it.
    """
    folder = out / FOLDER
    folder.mkdir(exist_ok=True)
    lock = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FileExistsError(f"another process flies a study into {str(out)!r}; wait for it, or end it") from None
        shutil.rmtree(folder.with_name(_DONE), ignore_errors=True)
        try:
            yield Cells(folder, of, dict(_read(folder, of, says)))
        finally:
            if unfinished(out) and not any(folder.iterdir()):
                folder.rmdir()
    finally:
        os.close(lock)


def _read(folder: Path, of: Identity, says: Callable[[str], None]) -> Iterator[tuple[Piece, Runs]]:
    for part in folder.glob(f"*{_UNFINISHED}"):
        part.unlink()
    for file in sorted(folder.glob(f"*{_ENDING}")):
        packed = opened(file.read_bytes())
        if packed is None:
            says(f"{file} is not whole: its runs fly anew")
            file.unlink()
            continue
        theirs, piece, runs = _unpacked(packed)
        if theirs != of:
            others = f"{str(folder)!r} has cells of another grid, different in {', '.join(differences(theirs, of))}"
            raise FileExistsError(f"{others}; name another directory with --out, or remove them to fly anew")
        yield piece, runs


def _packed(of: Identity, piece: Piece, runs: Runs) -> bytes:
    label = {"of": dict(of), "case": piece.case, "first": piece.runs.start, "end": piece.runs.stop}
    arrays = {"seconds": runs.seconds, "mean_error": runs.mean_error, "psi": runs.psi, **runs.bounds._asdict()}
    arrays |= {f"quantities/{name}": values for name, values in runs.quantities.items()}
    arrays |= {f"first/{name}": values for name, values in runs.first.items()}
    archive = io.BytesIO()
    np.savez(archive, label=np.array(json.dumps(label)), **arrays)
    packed: bytes = pa.compress(archive.getvalue(), codec=_COMPRESSION, asbytes=True)
    return packed


def _unpacked(packed: bytes) -> tuple[Identity, Piece, Runs]:
    with pa.input_stream(io.BytesIO(packed), compression=_COMPRESSION) as stream:
        archive = io.BytesIO(stream.read())
    with np.load(archive, allow_pickle=False) as arrays:
        label = json.loads(arrays["label"].item())

        def named(what: str) -> dict[str, Array]:
            return {name.removeprefix(what): arrays[name] for name in arrays.files if name.startswith(what)}

        runs = Runs(
            seconds=arrays["seconds"],
            mean_error=arrays["mean_error"],
            psi=arrays["psi"],
            bounds=Bounds(*(arrays[name] for name in Bounds._fields)),
            quantities=named("quantities/"),
            first=named("first/"),
        )
    return label["of"], Piece(label["case"], range(label["first"], label["end"])), runs


def _to_disk(path: Path) -> None:
    opened = os.open(path, os.O_RDONLY)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)
