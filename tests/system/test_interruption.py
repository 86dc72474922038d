"""A run that is asked to end by a signal leaves in order: no secrets, a summary, and the conventional exit status."""

import json
import signal
import subprocess
import sys

import psutil
import pytest
from awaiting import PATIENCE, await_true
from flying import PROCESSES
from own_code import ESTIMATOR, broken

from affinet.runtimes.interruption import Interrupted, Interruption, interruptible
from netem.medium import journal


def rows(book):
    try:
        return journal.read(book).num_rows
    except journal.JournalError:  # it has not even begun
        return 0


@pytest.fixture
def private(tmp_path):
    folder = tmp_path / "t"
    folder.mkdir()
    return folder


def interrupted(number, runtime, out, private, monkeypatch, again=False):
    monkeypatch.setenv("TMPDIR", str(private))
    command = [
        sys.executable,
        "-m",
        "affinet",
        "run",
        "corridor",
        "--duration",
        "600",
        "--estimator",
        "none",
    ]
    command += ["--runtime", runtime, "--set", "record.enabled=false"]
    launcher = subprocess.Popen(
        [*command, "--out", str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    book, children = out / "journal.arrows", []
    try:
        await_true(lambda: rows(book), "the run never got going")
        children = psutil.Process(launcher.pid).children(recursive=True)
        for _ in range(3 if again else 1):
            launcher.send_signal(number)
        _, complained = launcher.communicate(timeout=PATIENCE)
        _, alive = psutil.wait_procs(children, timeout=PATIENCE)
    finally:
        if launcher.poll() is None:
            launcher.kill()
            launcher.communicate()
    assert not alive
    return launcher.returncode, complained


@pytest.mark.parametrize(
    ("runtime", "number", "status"),
    [
        pytest.param("processes", signal.SIGTERM, 143, marks=PROCESSES),
        pytest.param("processes", signal.SIGHUP, 129, marks=[PROCESSES, pytest.mark.slow]),
        pytest.param("processes", signal.SIGINT, 130, marks=[PROCESSES, pytest.mark.slow]),
        pytest.param("inprocess", signal.SIGTERM, 143, marks=pytest.mark.slow),
        pytest.param("inprocess", signal.SIGHUP, 129),
        pytest.param("inprocess", signal.SIGINT, 130, marks=pytest.mark.slow),
    ],
)
def test_a_run_asked_to_end_leaves_a_summary_and_no_secrets(runtime, number, status, out, private, monkeypatch):
    left, complained = interrupted(number, runtime, out, private, monkeypatch, again=number == signal.SIGINT)
    name = signal.Signals(number).name
    assert left == status
    assert complained.splitlines()[-1] == f"interrupted by {name}"
    assert "Traceback" not in complained
    summary = json.loads((out / "summary.json").read_text())
    assert summary["verdict"] == "fail"
    assert summary["reasons"] == [f"interrupted by {name}"]
    assert summary["messages"]["offered"] >= 50 * 24 * 3  # ticks, links, and at least sensing, inputs and measurements
    assert not list(private.iterdir())  # passwords, socket, checkpoints
    assert not (out / "control.json").is_symlink()


def test_the_first_signal_counts_and_the_others_are_too_late():
    with interruptible() as interruption:
        interruption.heed()
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(Interrupted, match=r"^interrupted by SIGTERM$") as error:
            interruption.heed()
    assert error.value.status == 143


def test_what_is_ignored_stays_ignored_and_handlers_come_back():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as under nohup
    try:
        with interruptible() as interruption:
            signal.raise_signal(signal.SIGHUP)
            interruption.heed()
            assert signal.getsignal(signal.SIGTERM) == interruption.note
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)


def test_an_interruption_ends_whatever_a_keyboard_interrupt_ends():
    with pytest.raises(KeyboardInterrupt):
        Interruption(signal.SIGHUP).heed()


ENDLESS = broken(ESTIMATOR, ("late = np.max(own.tick) >= 7", "while np.max(own.tick) >= 2: open('here', 'w').close()"))


def test_code_without_an_end_is_ended_by_a_second_signal(tmp_path):
    """Before: by no signal but SIGKILL."""
    (tmp_path / "endless.py").write_text(ENDLESS)
    command = ["run", "corridor", "--estimator", "endless:Own", "--runtime", "inprocess", "--out", "run"]
    with subprocess.Popen(
        [sys.executable, "-m", "affinet", *command], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    ) as flying:
        try:
            await_true((tmp_path / "here").exists, "it never got there")
            flying.send_signal(signal.SIGINT)
            flying.send_signal(signal.SIGTERM)
            _, complained = flying.communicate(timeout=PATIENCE)
        finally:
            flying.kill()
    assert flying.returncode == 130, complained
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["reasons"] == ["interrupted by SIGINT"]


MEETS_CTRL_C = """
import importlib.abc, os, signal, sys

class Meets(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == {library!r}:
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt:
                raise ValueError("an error of its own") from None

sys.meta_path.insert(0, Meets())
signal.signal(signal.SIGINT, {handler})
sys.argv = ["affinet", "check", "corridor"]
from affinet.__main__ import command
command()
"""


@pytest.mark.parametrize("library", ["pydantic", "numpy", "affinet.cli.options", "affinet.cli.checking"])
def test_ctrl_c_that_a_library_meets_while_it_is_imported_ends_the_command_by_that(library):
    code = MEETS_CTRL_C.format(library=library, handler="signal.default_int_handler")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_ctrl_c_stays_ignored_where_it_is():
    code = MEETS_CTRL_C.format(library="pydantic", handler="signal.SIG_IGN")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
