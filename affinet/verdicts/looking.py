"""A run looked at in a notebook: in Rerun's viewer, or as a picture."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from affinet.verdicts import outcome, pictured
from affinet.verdicts.evidence import Evidence
from netem.core.parts import parts
from world.recording.file import RECORDING

_HIGH = 560  # pixels


def show(run: Evidence) -> None:
    """Show a run below the cell of a notebook.

    Raises
    ------
    RuntimeError
        Outside of one: with the command that shows its recording.
    """
    recording = _recording(run)
    if (display := _display()) is None:
        way = f"affinet watch {run.outcome.out}" if recording else "fly it with out=DIR, and `affinet watch DIR`"
        raise RuntimeError(f"there is no notebook to show it in: {way}")
    if not recording:
        _picture(run, display, "it left no recording: for one to look at in Rerun's viewer fly it with out=DIR")
        return
    try:
        from rerun_notebook import Viewer
    except ModuleNotFoundError:
        _picture(run, display, "for Rerun's viewer in place of this picture: pip install 'affinet[notebook]'")
        return
    viewer = Viewer(width="auto", height=_HIGH)
    for file in recording:
        viewer.send_rrd(file.read_bytes())
    display(viewer)


def _display() -> Callable[[Any], None] | None:
    """What shows something in the notebook that this is; None outside of one."""
    ipython = sys.modules.get("IPython")
    if ipython is None or ipython.get_ipython() is None:
        return None
    shown: Callable[[Any], None] = ipython.display.display
    return shown


def _picture(run: Evidence, display: Callable[[Any], None], says: str) -> None:
    from IPython.display import Image

    display(Image(pictured.png(run)))
    print(says)  # noqa: T201


def _recording(run: Evidence) -> list[Path]:
    """The files of its recording, if the run left one that is still there."""
    out = Path(run.outcome.out)
    try:
        said = json.loads((out / outcome.SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    is_its_own = isinstance(said, dict) and said.get("digest") == run.outcome.digest
    return parts(out / RECORDING) if is_its_own else []
