"""Executes the notebooks of docs/notebooks and stores what comes of it, in place.

    python docs/run_notebooks.py [losses estimator faults]

Each is executed from its first cell in a working directory of its own, by this interpreter. What differs from one execution to
the next is not stored: when a cell ran, and which Python ran it.
"""

from __future__ import annotations

import argparse
import base64
import io
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
from jupyter_client.kernelspec import KernelSpec, KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbformat import NotebookNode
from PIL import Image

FOLDER = Path(__file__).parent / "notebooks"
LONGEST_S = 300.0  # of a cell; one that takes longer hangs
_PNG = "image/png"
_DIGEST = re.compile("[0-9a-f]{12,64}")  # other processors have other bits
_ALIKE = {
    "MPLBACKEND": "module://matplotlib_inline.backend_inline",
    "COLUMNS": "80",
    "PYTEST_ADDOPTS": "",
}  # whoever executes them
_DRAWN = 0.01  # of a picture that is not blank, at least


class _ThisPython(KernelSpecManager):
    """Knows one kernel, this interpreter, whatever is installed."""

    def get_kernel_spec(self, kernel_name: str) -> KernelSpec:
        command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
        return KernelSpec(argv=[*command, "--HistoryManager.enabled=False"], display_name=kernel_name)


def read(file: Path) -> NotebookNode:
    """A notebook as it is stored."""
    return nbformat.read(file, as_version=4)


def executed(notebook: NotebookNode, longest_s: float = LONGEST_S) -> NotebookNode:
    """A notebook with what its cells, one after the other, put out when they are executed now.

    Parameters
    ----------
    notebook
        It stays as it is.
    longest_s
        That a cell may take.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        When a cell raises.
    nbclient.exceptions.CellTimeoutError
        When one takes longer.
    """
    fresh = nbformat.from_dict(notebook)
    with tempfile.TemporaryDirectory(prefix="affinet-") as folder:
        work, kernel = Path(folder) / "work", Path(folder) / "kernel"
        work.mkdir()
        kernel.mkdir()
        manager = AsyncKernelManager(
            kernel_spec_manager=_ThisPython(),
            transport="ipc",  # two notebooks at a time never reach for one port
            ip=str(kernel / "socket"),
            connection_file=str(kernel / "connection.json"),
        )
        client = NotebookClient(
            fresh,
            km=manager,
            timeout=longest_s,
            shutdown_kernel="immediate",
            coalesce_streams=True,
            record_timing=False,
            resources={"metadata": {"path": str(work)}},
        )
        client.execute(cleanup_kc=True, env=os.environ | _ALIKE | {"IPYTHONDIR": str(kernel)})
    fresh.metadata = nbformat.from_dict(
        {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    )
    return fresh


def differences(stored: NotebookNode, fresh: NotebookNode) -> list[str]:
    """What is other in the outputs of an execution than in those stored; of a picture, whether there is one, and not blank."""
    said = []
    for number, (one, other) in enumerate(zip_longest(_code(stored), _code(fresh))):
        outputs = ([] if cell is None else list(told(cell)) for cell in (one, other))
        for before, now in zip_longest(*outputs, fillvalue="nothing"):
            if before != now:
                said.append(f"cell {number + 1} has\n{now}\nwhere this is stored:\n{before}")
    return said


def _code(notebook: NotebookNode) -> list[NotebookNode]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def told(cell: NotebookNode) -> Iterator[str]:
    """What can be compared of the outputs of a cell: texts, and of a picture whether it shows something."""
    for output in cell.outputs:
        if "text" in output:
            yield f"{output.name}: {_plain(output.text)}"
        for kind, content in sorted(output.get("data", {}).items()):
            yield f"{kind}: {_seen(content) if kind == _PNG else _plain(content)}"


def _plain(text: str) -> str:
    return _DIGEST.sub("(digest)", text)


def _seen(png: str) -> str:
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(png))).convert("L"))
    drawn = 1.0 - np.bincount(pixels.ravel()).max() / pixels.size
    return "a picture" if drawn > _DRAWN else "a blank picture"


def _parsed() -> Any:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = sorted(file.stem for file in FOLDER.glob("*.ipynb"))
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which: {', '.join(names)}; all unless given")
    return parser.parse_args()


if __name__ == "__main__":
    for file in [FOLDER / f"{name}.ipynb" for name in _parsed().names] or sorted(FOLDER.glob("*.ipynb")):
        nbformat.write(executed(read(file)), file)
