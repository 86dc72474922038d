"""What a user calls things never enters the grammar of a key, an endpoint, a search path, markup or a shell raw."""

import io
import json
import os
import shlex
import sys
import tempfile
from pathlib import Path

import pytest
from flying import PROCESSES, digest_of, plan_of
from matplotlib.figure import Figure
from own_code import ESTIMATOR
from rerun.chunk import RrdReader
from rich.console import Console

from affinet.cli import progress, show
from affinet.runtimes import directories, forked, private
from affinet.runtimes.run import fly
from analysis.figures import curves
from analysis.models.finding import Finding
from netem.wire import keys
from netem.wire.keys import Keys

pytestmark = PROCESSES

SHORT = ("time.dt=0.05", "time.duration=0.5")

# Broke the keys of Zenoh: '#', '*', '?' and '$'; the others are here so that they stay harmless.
NAMES = ["hash#", "st*r", "**", "what?", "d$ollar", "sp ace", "qu'o\"te", "ünï", "new\nline", "-lead", "a:b", "x" * 250]


@pytest.mark.parametrize("name", NAMES)
def test_a_run_directory_of_any_name_is_flown_in(name, tmp_path):
    done = fly(plan_of("corridor", *SHORT), "inprocess", tmp_path / name, lambda *_: None)
    assert done.verdict == "pass"
    assert json.loads((tmp_path / name / "summary.json").read_text())["out"] == str(tmp_path / name)


def test_processes_fly_in_any_directory_with_any_search_path_and_temporary_folder(tmp_path, monkeypatch):
    # The name broke the keys, the colon PYTHONPATH, the long TMPDIR the socket, '#' and '?' in it the endpoint.
    folder, temporary = tmp_path / "a:b", tmp_path / f"t#{'x' * 100}?"
    folder.mkdir()
    temporary.mkdir()
    (folder / "named_oddly.py").write_text(ESTIMATOR)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    plan = plan_of("corridor", *SHORT, 'agents.estimator="named_oddly:Own"')
    done = fly(plan, "processes", tmp_path / "a*#?$\nb", lambda *_: None)
    assert (done.verdict, done.reasons) == ("pass", ())
    assert done.digest == digest_of("corridor", *SHORT, 'agents.estimator="named_oddly:Own"')


def test_a_pandas_that_is_installed_is_imported_by_no_process(tmp_path, monkeypatch):
    # Arrow does so at its first array, if it is not kept from it: flights took three times the processor time.
    installed, imported = tmp_path / "installed", tmp_path / "imported"
    installed.mkdir()
    (installed / "pandas.py").write_text(
        f"import sys\nopen({str(imported)!r}, 'a').write(sys.argv[-1])\nraise ImportError"
    )
    monkeypatch.syspath_prepend(str(installed))
    done = fly(plan_of("corridor", *SHORT), "processes", tmp_path / "run", lambda *_: None)
    assert (done.verdict, done.reasons) == ("pass", ())
    assert not imported.exists()


def test_the_name_of_a_run_on_the_air_is_its_own_and_nothing_a_user_wrote():
    assert keys.fresh() != keys.fresh()
    assert Keys(keys.fresh()).sense.count("/") == 3


@pytest.mark.parametrize("name", ["", "a/b", "a*", "a#", "a?", "$a", "a b", "é", "a\n"])
def test_a_name_with_a_meaning_in_a_key_is_refused(name):
    with pytest.raises(ValueError, match="use letters, digits, '_' and '-'"):
        Keys(name)


@pytest.mark.parametrize("odd", ["x" * 84, "a#b", "a?b", "a;b", "é", "a b"])
def test_a_socket_lies_where_its_path_is_short_and_plain(odd, tmp_path, monkeypatch):
    folder = tmp_path / odd
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    assert private.socket_folder() == "/tmp"


def test_a_short_and_plain_temporary_folder_is_taken(monkeypatch):
    with tempfile.TemporaryDirectory(dir="/tmp", prefix="plain-") as folder:
        monkeypatch.setattr(tempfile, "tempdir", folder)
        assert private.socket_folder() == folder


def test_where_no_folder_will_do_it_is_said_what_would(monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", "/" + "x" * 90)
    monkeypatch.setattr(private, "_PLACES", ("/nowhere",))
    with pytest.raises(OSError, match="set TMPDIR to a plain path of at most 83 characters"):
        private.socket_folder()


def test_a_child_searches_where_its_launcher_does(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path / "a:b"), ""])
    *_, path, dash_m, package, _, _ = forked.program(tmp_path)
    assert (dash_m, package) == ("-m", "affinet.runtimes.nursery")
    assert json.loads(path) == [os.path.abspath(entry) for entry in sys.path if entry]


def test_recordings_of_two_runs_with_one_name_stay_two(tmp_path):
    stores = []
    for folder in ("one", "two"):  # a viewer showed both as one recording
        fly(plan_of("corridor", *SHORT), "inprocess", tmp_path / folder / "run", lambda *_: None)
        (entry,) = RrdReader(str(tmp_path / folder / "run" / "run.rrd")).recordings()
        stores.append((entry.application_id, entry.recording_id))
    assert len({recording for _, recording in stores}) == 2
    assert {application for application, _ in stores} == {"affinet"}


TEXTS = ["[red]odd[/red]", "[/]", ":bug:", "[link=file:///]x[/link]", "back\\", "\x1b[31mred"]


@pytest.mark.parametrize("text", TEXTS)
def test_text_of_a_user_is_shown_as_it_stands(text, monkeypatch):
    page = io.StringIO()
    monkeypatch.setattr(show, "Console", lambda **_: Console(file=page, width=200))
    show.findings(text, [Finding(text, "note", text)])
    shown = text.replace("\x1b", "\\x1b")
    title, *_, row, _end = page.getvalue().splitlines()
    assert shown in title
    assert row.count(shown) == 2


@pytest.mark.parametrize("text", TEXTS)
def test_the_progress_of_a_run_shows_its_name_as_it_stands(text, monkeypatch):
    page = io.StringIO()
    monkeypatch.setattr(progress, "Console", lambda **_: Console(file=page, width=200))
    with show.Progress(plan_of("corridor", *SHORT), text, Path(text)) as shown_in:
        shown_in.see(3, 0.5)
    shown, out = (each.replace("\x1b", "\\x1b") for each in (text, str(Path(text))))
    assert f"{shown} flies in {out}" in page.getvalue()


@pytest.mark.parametrize("title", ["costs $5", "$\\frac$", "50 % of $x", "a_b^c"])
def test_a_title_is_no_formula(title, tmp_path):
    figure = Figure()
    figure.suptitle(title)
    assert curves.mpl.rcParams["text.parse_math"] is False
    figure.savefig(tmp_path / "figure.png")  # '$\frac$' raised, two dollars set what is between them in italics


@pytest.mark.parametrize("path", ["a b", "it's", "$HOME", "-x", "a;b", "a\nb"])
def test_a_path_in_a_command_to_repeat_is_one_word_and_no_option(path):
    (word,) = shlex.split(directories.on_a_command_line(Path(path)))
    assert not word.startswith("-")
    assert Path(word) == Path(path)


@pytest.mark.parametrize(
    ("name", "shown"), [("x" * 251, "x" * 180), ("é" * 120, "é" * 90), ("a\nb", "a_b"), ("\udcff", "_"), ("#?", "#?")]
)
def test_a_default_directory_fits_any_name_of_a_scenario(name, shown, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = directories.for_run(name)
    assert out.is_dir()
    assert out.name.startswith(f"{shown}-2")
