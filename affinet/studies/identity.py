"""What the bits of a study's cells come of: what flies, whose code flies it, and how this machine rounds.

Cells with equal identities are the same bits wherever and whenever they fly: so cells that were kept are taken for a study
that goes on, and workers of a cluster fly for it.
"""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel
from scipy.special import ndtr, ndtri

from affinet import rooms
from affinet.planning.plan import Plan
from affinet.scenario import inputs
from affinet.studies import record
from affinet.studies.study import Study

Identity = Mapping[str, str]
Module = tuple[str, str]  # "module:Class", and the folder it lies in

GRID = "the grid"

# All that a cell goes through when it flies, a test finds, and no more: a figure may be mended while a study is under way.
_FLIES: Mapping[str, Sequence[str]] = {
    "affinet": ("planning", "runtimes", "scenario", "verdicts", "studies/batch.py", "studies/study.py"),
    "agents": (".",),
    "analysis": ("kernels", "metrics", "models"),
    "netem": (".",),
    "world": (".",),
}
VERSIONS = ("affinet", "python", "numpy", "scipy")
_OF_PLANS = [field.name for field in fields(Plan) if field.name != "findings"]  # which fly nowhere


def of_cells(study: Study, plans: Sequence[Plan], *, quick: bool) -> Identity:
    """That of the cells of a study, flown here."""
    flies = of_plans(plans)
    return {GRID: record.grid(study, quick=quick), "what flies": flies, **here(own_modules(plans))}


def of_plans(plans: Iterable[Plan]) -> str:
    """A digest of what flies by these plans, in which is all that was read for them."""
    return digest([getattr(plan, name) for plan in plans for name in _OF_PLANS])


def own_modules(plans: Iterable[Plan]) -> list[Module]:
    """Modules of a user's own that fly in these plans."""
    return sorted({(name, str(folder)) for plan in plans for name, folder in plan.scenario.own_modules.items()})


def here(own: Iterable[Module]) -> Identity:
    """Of what the bits come in this process, whatever flies, and with these modules of a user's own."""
    return {
        "affinet": f"{version('affinet')}, code {_code_digest()}",
        "python": ".".join(platform.python_version_tuple()[:2]),
        "numpy": version("numpy"),
        "scipy": version("scipy"),
        "the rounding of linear algebra": _rounding(),
        **{
            f"{name} in {folder}": _digest_of_files(inputs.files_of_modules(name, Path(folder))) for name, folder in own
        },
    }


def differences(one: Identity, other: Identity) -> Iterator[str]:
    """In which of their parts two of them differ, in words; of versions, what each has."""
    for name in dict.fromkeys([*one, *other]):
        if one.get(name) != other.get(name):
            yield f"{name} ({one.get(name)}, here {other.get(name)})" if name in VERSIONS else name


def digest(value: Any) -> str:
    """Of all that something is made of, bit for bit; what nobody knows how to take apart is never the same again."""
    taken = hashlib.sha256()
    for part in _parts(value):
        taken.update(b"%d:" % len(part) + part)
    return taken.hexdigest()[:16]


def _parts(value: Any) -> Iterator[bytes]:
    yield type(value).__qualname__.encode()
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield value.tobytes()
    elif isinstance(value, float):
        yield value.hex().encode()
    elif isinstance(value, list | tuple):
        yield str(len(value)).encode()
        for one in value:
            yield from _parts(one)
    elif isinstance(value, Mapping):
        yield from _parts([part for item in value.items() for part in item])
    elif isinstance(value, BaseModel):
        yield from _parts({name: getattr(value, name) for name in type(value).model_fields})
    elif is_dataclass(value):
        yield from _parts({field.name: getattr(value, field.name) for field in fields(value)})
    else:
        yield repr(value).encode()


def _code_digest() -> str:
    parts = (rooms.folder(room) / part for room, names in _FLIES.items() for part in names)
    return _digest_of_files(
        file for part in parts for file in ([part] if part.is_file() else sorted(part.rglob("*.py")))
    )


def _digest_of_files(files: Iterable[Path]) -> str:
    return digest([(file.name, file.read_bytes()) for file in files])


def _rounding() -> str:
    """A digest of what decision 1 found to round by CPU, BLAS and C library, of some numbers."""
    made = []
    for size in (3, 8, 120):  # from 100 on, by the number of threads too
        numbers = (np.arange(size * size) * 7919 % 1009 / 1009.0).reshape(size, size)
        positive = numbers @ numbers.T + np.eye(size)
        values, vectors = np.linalg.eigh(positive)
        made += [positive, np.linalg.inv(positive), np.linalg.solve(positive, numbers), np.linalg.cholesky(positive)]
        made += [values, vectors, *np.linalg.svd(numbers), ndtr(numbers), ndtri(numbers)]
    return digest([np.asarray(one) for one in made])
