"""The notebooks of docs/notebooks say what comes of them when they are executed now."""

import copy
import json
import os
import re
import sys

import nbformat
import psutil
import pytest
from flying import PROCESSES
from nbclient.exceptions import CellExecutionError, CellTimeoutError
from paths import DOCS
from run_notebooks import FOLDER, differences, executed, read, told

NAMES = sorted(file.stem for file in FOLDER.glob("*.ipynb"))
_OF_A_MACHINE = re.compile(r"\b0x[0-9a-f]{6,}|/(?:tmp|home|root|usr|var)/|site-packages|\bin \d+\.\d+s\b")
BLANK = "image/png: a blank picture"


def outputs(notebook):
    return [said for cell in notebook.cells if cell.cell_type == "code" for said in told(cell)]


def notebook_of(*codes):
    cells = [nbformat.v4.new_code_cell(code, id=f"cell-{number}") for number, code in enumerate(codes)]
    return nbformat.v4.new_notebook(cells=cells)


@pytest.mark.parametrize("name", [pytest.param(name, marks=PROCESSES if name == "estimator" else ()) for name in NAMES])
def test_a_notebook_has_the_outputs_that_its_cells_have(name):
    stored = read(FOLDER / f"{name}.ipynb")
    assert differences(stored, executed(stored)) == []


@pytest.mark.parametrize("name", NAMES)
def test_what_is_stored_is_small_and_of_no_machine(name):
    stored = read(FOLDER / f"{name}.ipynb")
    said = outputs(stored)
    assert said.count("image/png: a picture") >= 3
    assert BLANK not in said
    assert [one for one in said if one.startswith("stderr") or _OF_A_MACHINE.search(one)] == []
    assert (FOLDER / f"{name}.ipynb").stat().st_size < 300_000
    assert f"notebooks/{name}.ipynb" in (DOCS / "library.md").read_text()


def test_there_are_notebooks():
    assert len(NAMES) >= 3


# ---- planted


DRAWS = "import matplotlib.pyplot as plt\n_, ax = plt.subplots()\nax.plot([1, 2]); print('drawn')"
HIDES = "import matplotlib.pyplot as plt\n_, ax = plt.subplots()\nax.axis('off'); print('drawn')"


@pytest.fixture(scope="module")
def small():
    """A notebook that was executed."""
    return executed(notebook_of("print(6 * 7)", DRAWS, "'words'"))


def test_what_is_executed_again_is_the_same_to_the_letter(small):
    assert outputs(small) == [
        "stdout: 42\n",
        "stdout: drawn\n",
        "image/png: a picture",
        "text/plain: <Figure size 640x480 with 1 Axes>",
        "text/plain: 'words'",
    ]
    assert nbformat.writes(executed(small)) == nbformat.writes(small)


@pytest.mark.parametrize(
    ("cell", "change"),
    [
        (0, lambda cell: cell.outputs[0].update(text="43\n")),
        (0, lambda cell: cell.outputs.clear()),
        (1, lambda cell: cell.outputs.pop()),
        (1, lambda cell: cell.outputs[1].data.pop("image/png")),
        (2, lambda cell: cell.outputs[0].data.update({"text/plain": "'Words'"})),
        (2, lambda cell: cell.outputs.append(nbformat.v4.new_output("stream", text="more\n"))),
    ],
    ids=["another text", "no output", "no picture", "a figure without its picture", "another value", "an output more"],
)
def test_an_output_that_a_cell_has_not_is_found(cell, change, small):
    wrong = copy.deepcopy(small)
    change(wrong.cells[cell])
    assert differences(wrong, small)[0].startswith(f"cell {cell + 1} has\n")
    assert differences(small, small) == []


def test_this_interpreter_executes_in_a_folder_of_its_own_whatever_is_installed(tmp_path, monkeypatch):
    other = tmp_path / "kernels" / "python3" / "kernel.json"
    other.parent.mkdir(parents=True)
    other.write_text(json.dumps({"argv": ["false"], "display_name": "other", "language": "python"}))
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path))
    asked = f"import os, sys\nprint(sys.executable == {sys.executable!r}, os.listdir(), os.getcwd() == {os.getcwd()!r})"
    assert outputs(executed(notebook_of(asked))) == ["stdout: True [] False\n"]


def test_a_picture_that_shows_nothing_is_found(small):
    hidden = executed(notebook_of("print(6 * 7)", HIDES, "'words'"))
    assert BLANK in outputs(hidden)
    assert any("a blank picture" in said for said in differences(small, hidden))


def kernels():
    mine = psutil.Process().children(recursive=True)
    return [one for one in mine if any("ipykernel_launcher" in word for word in one.cmdline())]


def test_a_cell_that_raises_is_found_and_its_kernel_ends():
    with pytest.raises(CellExecutionError, match="ZeroDivisionError"):
        executed(notebook_of("1 / 0"))
    assert kernels() == []


HANGS = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\nwhile True:\n    pass"


def test_a_cell_that_hangs_is_found_and_its_kernel_ends():
    with pytest.raises(CellTimeoutError):
        executed(notebook_of(HANGS), longest_s=1.0)
    assert kernels() == []
