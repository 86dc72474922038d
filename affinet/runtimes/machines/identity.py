"""What machines of one run have to have in common: versions, code, and the bits that they compute."""

from __future__ import annotations

import hashlib
import platform
from dataclasses import dataclass, fields
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from affinet.scenario.sections import Scenario
from netem.core.listing import listed
from netem.processes.user_code import OURS

PROTOCOL = 1  # of the messages in `joining.py`: whoever changes what they mean counts on

_SAME = "install the same on both (uv sync --locked)"
_WAYS_OUT = {
    "code": "the same version has other code there: install the same on both",
    "arithmetic": "their CPUs, or the libraries chosen by them, compute other bits: set the same NPY_DISABLE_CPU_FEATURES and "
    "OPENBLAS_CORETYPE on both, or leave that machine out",
}


@dataclass(frozen=True)
class Identity:
    """What a machine flies with.

    Parameters
    ----------
    protocol
        Of the messages between machines.
    affinet, python, numpy, zenoh
        Versions.
    code
        Digest of affinet's own files.
    arithmetic
        Digest of what NumPy and its linear algebra make of fixed numbers here: the kernels that they choose by the CPU.
    """

    protocol: int
    affinet: str
    python: str
    numpy: str
    zenoh: str
    code: str
    arithmetic: str

    def difference(self, other: Identity) -> str | None:
        """What another machine has that this one has not, in one line with the way out; None where all is the same."""
        differing = [field.name for field in fields(self) if getattr(self, field.name) != getattr(other, field.name)]
        if not differing:
            return None
        said = listed(f"{name} is {getattr(other, name)} there, and {getattr(self, name)} here" for name in differing)
        return f"{said}; {_WAYS_OUT.get(differing[0], _SAME)}"


@cache
def own() -> Identity:
    """Of this machine."""
    return Identity(
        PROTOCOL,
        version("affinet"),
        platform.python_version(),
        np.__version__,
        version("eclipse-zenoh"),
        _digest_of_code(),
        _digest_of_arithmetic(),
    )


def digest_of(scenario: Scenario) -> str:
    """What tells one scenario from another: all its keys, as resolved."""
    return hashlib.blake2b(scenario.model_dump_json(exclude_none=True).encode(), digest_size=16).hexdigest()


def _digest_of_code() -> str:
    summed = hashlib.blake2b(digest_size=8)
    for package in sorted(OURS):
        spec = find_spec(package)
        folders = spec.submodule_search_locations if spec else None
        for folder in map(Path, folders or ()):
            for file in sorted(folder.rglob("*.py")):
                summed.update(f"{package}/{file.relative_to(folder)}\0".encode())
                summed.update(file.read_bytes())
    return summed.hexdigest()


def _digest_of_arithmetic() -> str:
    side = 48
    count = np.arange(1.0, side * side + 1.0)
    table = np.modf(count * 0.6180339887498949)[0].reshape(side, side)
    positive = table @ table.T + side * np.eye(side)
    computed = (
        positive,
        np.linalg.cholesky(positive),
        np.linalg.inv(positive),
        np.linalg.svd(table, compute_uv=False),
        np.linalg.eigvalsh(positive),
        *(function(table) for function in (np.exp, np.log, np.sin, np.cos, np.sqrt, np.sum)),
        table**3,
    )
    summed = hashlib.blake2b(digest_size=8)
    for array in computed:
        summed.update(np.ascontiguousarray(array).tobytes())
    return summed.hexdigest()
