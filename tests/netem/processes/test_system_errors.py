"""What the system refuses is one line with the way out, or a failed run that says so; never a traceback, never a pass."""

import errno
import json
import os
import resource
import subprocess
from pathlib import Path

import pytest
from flying import PROCESSES, plan_of
from limits import limit

from affinet.cli.commands import main
from affinet.runtimes import rerun_command
from affinet.runtimes import run as running
from affinet.runtimes.inject import Access
from affinet.runtimes.rerun_command import NotMended, NoViewer
from affinet.runtimes.run import fly
from netem.medium import journal
from netem.medium.medium import JOURNAL
from netem.processes.system_errors import about, afterwards, said
from netem.wire.session import Login
from world.recording.file import wrong_with
from world.recording.logbook import RunWriter

pytestmark = PROCESSES

SHORT = ("time.dt=0.05", "time.duration=0.5")
RUN = ["run", "corridor", "--set", "time.dt=0.05", "--duration", "0.5", "--runtime", "inprocess"]


def in_one_line(capsys):
    """What was said on standard error, a line that is no traceback."""
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert "Traceback" not in line
    return line


def summary(out):
    return json.loads((out / "summary.json").read_text())


# ---- a line with the way out


@pytest.mark.parametrize(
    ("number", "way_out"),
    [
        (errno.ENOSPC, "No space left on device; free some room or raise the limit (ulimit -f), or write to another"),
        (errno.EFBIG, "File too large; free some room or raise the limit (ulimit -f), or write to another place"),
        (errno.EROFS, "Read-only file system; get the right to it, or write to another place"),
        (errno.EACCES, "Permission denied; get the right to it, or write to another place"),
        (errno.ENOTDIR, "Not a directory; a file is where a directory is due, or the other way round: name another"),
        (errno.ENAMETOOLONG, "File name too long; give it a shorter name"),
        (errno.EMFILE, "Too many open files; raise the limit of open files (ulimit -n)"),
        (
            errno.EAGAIN,
            "Resource temporarily unavailable; raise the limit (ulimit -u, or memory), or fly in one process",
        ),
        (errno.EIO, "Input/output error"),
    ],
)
def test_an_error_names_the_file_and_the_way_out(number, way_out):
    with pytest.raises(OSError, match="as a library") as caught, about(Path("a\nb")):
        raise OSError(number, "as a library has it")
    assert said(caught.value).startswith(f"'a\\nb': {way_out}")
    assert "\n" not in said(caught.value)


@pytest.mark.parametrize("runtime", ["inprocess", "processes"])
@pytest.mark.parametrize(
    ("out", "line"),
    [
        ("file/run", "'file/run': Not a directory; a file is where a directory is due"),
        ("file", "'file': File exists; a file is where a directory is due"),
        ("x" * 300, f"'{'x' * 300}': File name too long; give it a shorter name"),
        ("/proc/run", "'/proc/run': "),
        ("a\udcff", "'a\\udcff' is no UTF-8"),
    ],
    ids=["below a file", "a file", "too long", "unwritable", "no UTF-8"],
)
def test_a_run_that_cannot_be_put_where_it_should_is_bad_input(out, line, runtime, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    assert main([*RUN[:-1], runtime, "--out", out]) == 2
    assert in_one_line(capsys).startswith(line)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_the_right_to_write_is_bad_input(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    tmp_path.chmod(0o500)
    assert main(RUN) == 2
    assert in_one_line(capsys) == "'runs': Permission denied; get the right to it, or write to another place"


COMMANDS = {
    "run": ["run", "corridor"],
    "replay": ["replay", "flown"],
    "study": ["study", "paper-000-fig12", "--quick"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_file_where_the_default_directory_is_due_is_bad_input(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    if command == "replay":
        fly(plan_of("corridor", *SHORT), "inprocess", Path("flown"), lambda *_: None)
    for folder in ("runs", "studies"):
        Path(folder).touch()
    assert main(COMMANDS[command]) == 2
    assert "File exists; a file is where a directory is due, or the other way round: name another" in in_one_line(
        capsys
    )


@pytest.mark.parametrize("command", ["run", "check", "check-determinism", "study", "hunt", "fit", "inject", "replay"])
def test_what_cannot_be_read_is_bad_input_of_every_command(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    named = "x" * 300 + ".toml"
    options = {"hunt": ["--invariant", "bounded(5)"], "inject": ["show"]}.get(command, [])
    assert main([command, named, *options]) == 2
    assert "File name too long" in in_one_line(capsys)


def test_a_system_without_threads_for_the_display_is_bad_input(monkeypatch, capsys):
    def refuse(_):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("affinet.cli.show.Progress.__enter__", refuse)
    assert main([*RUN, "--out", "nowhere"]) == 2
    assert in_one_line(capsys).startswith("Resource temporarily unavailable; raise the limit (ulimit -u, or memory)")


# ---- a run that could not be written down


@pytest.mark.parametrize(
    ("size", "seconds"),
    [(40_000, 0.5), (2**18 + 5000, 10)],  # the first hung for good, the second passed
    ids=["at the start", "on the way"],
)
def test_a_recording_that_breaks_off_fails_the_run(size, seconds, out):
    plan = plan_of("corridor", "time.dt=0.05", f"time.duration={seconds}", "record.every=1")
    with limit(resource.RLIMIT_FSIZE, size):
        done = fly(plan, "inprocess", out, lambda *_: None)
    assert done.verdict == "fail"
    (reason,) = done.reasons
    assert "run.rrd" in reason
    assert "ulimit -f" in reason
    assert summary(out)["reasons"] == [reason]


def test_a_recording_that_breaks_off_fails_a_run_over_processes(out):
    plan = plan_of("corridor", *SHORT, "record.every=1")
    with limit(resource.RLIMIT_FSIZE, 40_000):
        done = fly(plan, "processes", out, lambda *_: None)
    assert done.verdict == "fail"
    assert done.reasons[0].startswith("world: ")
    assert "run.rrd" in done.reasons[0]
    assert "Traceback" not in done.reasons[0]
    assert summary(out)["reasons"] == list(done.reasons)


@pytest.mark.parametrize("size", [0, 3000])
def test_tables_and_arrays_that_do_not_fit_fail_the_run(size, out, monkeypatch):
    plan = plan_of("corridor", *SHORT, "record.enabled=false")
    out.mkdir()
    monkeypatch.setattr(running.outcome, "prepare", lambda *_: None)
    monkeypatch.setattr(running.outcome.Outcome, "save", lambda _: None)
    with limit(resource.RLIMIT_FSIZE, size):
        done = fly(plan, "inprocess", out, lambda *_: None)
    assert done.verdict == "fail"
    (reason,) = done.reasons
    assert reason.startswith("the run could not be written down: ")
    assert reason.endswith("File too large; free some room or raise the limit (ulimit -f), or write to another place")


def test_rerun_turned_off_fails_the_run_at_once(out, monkeypatch):
    monkeypatch.setenv("RERUN", "off")  # it passed, without a recording
    done = fly(plan_of("corridor", *SHORT), "inprocess", out, lambda *_: pytest.fail("it flew"))
    assert done.verdict == "fail"
    assert (
        "run.rrd cannot be written: RERUN=off in the environment turns the recording off; unset it" in done.reasons[0]
    )
    assert summary(out)["verdict"] == "fail"


def test_without_a_recording_wanted_rerun_may_be_off(out, monkeypatch):
    monkeypatch.setenv("RERUN", "off")
    plan = plan_of("corridor", *SHORT, "record.enabled=false")
    assert fly(plan, "inprocess", out, lambda *_: None).verdict == "pass"


def test_a_recording_that_is_gone_in_the_end_fails_the_run(out):
    def remove(*_):
        (out / "run.rrd").unlink(missing_ok=True)

    done = fly(plan_of("corridor", *SHORT), "inprocess", out, remove)
    assert done.reasons == (f"the run could not be written down: {out / 'run.rrd'} was never written",)


def test_a_summary_that_cannot_be_written_fails_the_run(out):
    def hinder(*_):
        (out / "summary.json").mkdir(exist_ok=True)

    done = fly(plan_of("corridor", *SHORT), "inprocess", out, hinder)
    assert done.verdict == "fail"
    assert done.reasons[0].startswith(f"the summary is not written: '{out}/summary.")
    assert "Is a directory" in done.reasons[0]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("whole") / "run"
    fly(plan_of("corridor", *SHORT), "inprocess", out, lambda *_: None)
    return (out / "run.rrd").read_bytes()


@pytest.mark.parametrize(
    ("hurt", "wrong"),
    [
        (lambda data: data, None),
        (lambda data: data[:-1], "breaks off after"),
        (lambda data: data[: len(data) // 2], "breaks off after"),
        (lambda data: data[:20000] + data[20001:], "breaks off after"),  # a byte was lost on the way
        (lambda data: data + b"x", "breaks off after"),
        (lambda data: data[:5], "breaks off after 5 bytes"),
        (lambda _: b"", "breaks off after 0 bytes: was the disk full, or ulimit -f too low?"),
    ],
    ids=["whole", "last byte", "half", "hole", "more", "begun", "empty"],
)
def test_a_recording_is_whole_to_its_last_byte(hurt, wrong, whole, tmp_path):
    file = tmp_path / "run.rrd"
    file.write_bytes(hurt(whole))
    assert (wrong_with(file) is None) if wrong is None else (wrong in wrong_with(file))


def test_of_a_summary_that_does_not_fit_nothing_is_left(out, monkeypatch):
    """Before: an empty file, which no reader takes."""
    write = Path.write_text

    def full(path, text, *given, **how):
        if "summary" not in path.name:
            return write(path, text, *given, **how)
        write(path, "")
        raise OSError(errno.ENOSPC, "full", str(path))

    monkeypatch.setattr(Path, "write_text", full)
    done = fly(plan_of("corridor", *SHORT, "record.enabled=false"), "inprocess", out, lambda *_: None)
    assert done.reasons[0].startswith("the summary is not written: ")
    assert not [path for path in out.iterdir() if "summary" in path.name]


def test_a_device_that_is_full_is_told_where_the_recording_begins(out, monkeypatch):
    monkeypatch.setattr("world.recording.logbook.RECORDING", "/dev/full")
    done = fly(plan_of("corridor", *SHORT), "inprocess", out, lambda *_: None)
    assert done.reasons[0].startswith(
        "the run could not be written down: '/dev/full': No space left on device; free some"
    )


# ---- a swarm that could not be launched


@pytest.mark.parametrize("refused", [errno.EMFILE, errno.EAGAIN, errno.ENOMEM])
def test_a_swarm_that_cannot_be_launched_fails_and_says_why(refused, out, monkeypatch):
    def refuse(*_, **__):
        raise OSError(refused, os.strerror(refused))

    monkeypatch.setattr("affinet.runtimes.forked.Program", refuse)
    done = fly(plan_of("corridor", *SHORT, "record.enabled=false"), "processes", out, lambda *_: None)
    assert done.reasons == (f"the swarm could not be launched: {said(OSError(refused, ''))}",)
    assert summary(out)["verdict"] == "fail"


def test_too_few_files_for_a_swarm_fail_it(out):
    plan = plan_of("corridor", *SHORT, "record.enabled=false")
    with limit(resource.RLIMIT_NOFILE, len(os.listdir("/proc/self/fd")) + 6):
        done = fly(plan, "processes", out, lambda *_: None)
    assert done.verdict == "fail"
    assert done.reasons[0].endswith("Too many open files; raise the limit of open files (ulimit -n)")


@pytest.fixture
def unmendable(monkeypatch):
    """The command of Rerun cannot mend anything."""
    done = subprocess.CompletedProcess([], 1, b"", b"it tried\nno such luck\n")
    monkeypatch.setattr(rerun_command, "_rrd", lambda *_: done)


@pytest.mark.usefixtures("unmendable")
def test_a_recording_that_cannot_be_mended_does_not_hide_why_the_run_failed(out, monkeypatch):
    def crash(launcher):
        (out / "run.rrd").write_bytes(b"RRF2")
        launcher.flight.failure = "the first failure"

    monkeypatch.setattr(running.Launcher, "fly", crash)
    done = fly(plan_of("corridor", *SHORT), "processes", out, lambda *_: None)
    (reason,) = done.reasons
    assert reason == f"the first failure; {out / 'run.rrd'} breaks off, and cannot be mended: no such luck"


def test_a_journal_that_cannot_be_read_does_not_hide_why_the_run_failed(out, monkeypatch):
    def crash(launcher):
        (out / "journal.arrows").write_bytes(b"no table")
        launcher.flight.failure = "the first failure"

    monkeypatch.setattr(running.Launcher, "fly", crash)
    (reason,) = fly(plan_of("corridor", *SHORT), "processes", out, lambda *_: None).reasons
    assert reason.startswith(f"the first failure; {out / 'journal.arrows'}: no such table")


# ---- clean-up


def broken(name):
    def step():
        raise OSError(errno.ENOSPC, "full", name)

    return step


def test_every_step_of_a_clean_up_is_taken_and_the_first_failure_is_the_one_that_is_raised():
    taken = []
    with (
        pytest.raises(KeyError, match="first") as caught,
        afterwards(broken("a"), lambda: taken.append(1), broken("b")),
    ):
        raise KeyError("first")
    assert taken == [1]
    assert [note[:15] for note in caught.value.__notes__] == ["and then: 'a': ", "and then: 'b': "]
    with pytest.raises(OSError, match="'a'"), afterwards(broken("a"), broken("b")):
        pass


def test_a_logbook_that_cannot_be_closed_does_not_hide_what_ended_the_run(out, monkeypatch):
    plan = plan_of("corridor", *SHORT, "record.enabled=false")
    out.mkdir()
    monkeypatch.setattr("netem.core.arrow.Stream.close", lambda _: broken("a table")())
    for table in (
        RunWriter(out, "run", plan.world, plan.channels, plan.reports, plan.books(None)),
        journal.Writer(out / JOURNAL, plan.world.links, plan.channels, 50),
    ):
        with pytest.raises(KeyError, match="first"), table:
            raise KeyError("first")


def test_access_that_is_gone_does_not_hide_what_ended_the_run(tmp_path):
    private = tmp_path / "private"
    private.mkdir()

    def interrupted():
        with Access("run", Login("", "", "")).granted(tmp_path, private):
            (tmp_path / "control.json").unlink()
            raise KeyError("first")

    with pytest.raises(KeyError, match="first"):
        interrupted()


# ---- the mending


@pytest.mark.usefixtures("unmendable")
def test_what_cannot_be_mended_stays_as_it_was(tmp_path):
    (tmp_path / "run.rrd").write_bytes(b"RRF2")
    with pytest.raises(NotMended, match="breaks off, and cannot be mended"):
        rerun_command.mend(tmp_path / "run.rrd")
    assert [path.name for path in tmp_path.iterdir()] == ["run.rrd"]


def test_the_command_that_is_missing_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(rerun_command, "find_spec", lambda _: None)
    with pytest.raises(NoViewer, match="is not there: install rerun-sdk again"):
        rerun_command.mend(tmp_path / "run.rrd")
