"""Builds affinet (PEP 517): an sdist and an editable install as hatchling does, a wheel of the rooms laid within `affinet`.

A wheel is a neighbour of others: `agents` is a name of openai-agents, and `world` or `analysis` one of many a project. It is
always built of what an sdist holds, so that it is the same from the repository and from the sdist.
"""

from __future__ import annotations

import contextlib
import tarfile
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import tomli_w
from hatchling import build as hatchling
from hatchling.build import (
    build_editable,
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
)
from laying import lay, project_within

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
]


def build_wheel(
    wheel_directory: str, config_settings: dict[str, Any] | None = None, metadata_directory: str | None = None
) -> str:
    """Build the wheel; returns the name of its file."""
    out = str(Path(wheel_directory).absolute())
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(Path(folder) / str(build_sdist(folder))) as archive:
            archive.extractall(folder, filter="data")
        (tree,) = (entry for entry in Path(folder).iterdir() if entry.is_dir())
        project = tree / "pyproject.toml"
        lay(tree)
        project.write_text(tomli_w.dumps(project_within(tomllib.loads(project.read_text(encoding="utf-8")))), "utf-8")
        with contextlib.chdir(tree):
            return str(hatchling.build_wheel(out, config_settings, metadata_directory))
