"""A run directory belongs to one run, however many start together."""

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest
from flying import plan_of

from affinet.cli.commands import main
from affinet.runtimes import directories
from affinet.runtimes.run import fly
from affinet.studies import report
from affinet.verdicts import outcome

TOGETHER = 8
SHORT = ["--set", "time.dt=0.05", "--duration", "0.2", "--runtime", "inprocess"]


def at_once(ask):
    """What eight who ask together get; an error where one is refused."""
    barrier = Barrier(TOGETHER)

    def asked(_):
        barrier.wait()
        try:
            return ask()
        except OSError as error:
            return error

    with ThreadPoolExecutor(TOGETHER) as pool:
        return list(pool.map(asked, range(TOGETHER)))


@pytest.fixture
def still(tmp_path, monkeypatch):
    """A folder to work in, where the clock stands still."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(time, "strftime", lambda _: "20260101-000000")


@pytest.mark.usefixtures("still")
@pytest.mark.parametrize(
    ("ask", "first", "second"),
    [
        (directories.for_run, "runs/name-20260101-000000", "runs/name-20260101-000000-2"),
        (directories.for_study, "studies/name", "studies/name-2"),
        (directories.for_hunt, "hunted-name.toml", "hunted-name-2.toml"),
        (directories.for_certificate, "certified-name.json", "certified-name-2.json"),
    ],
    ids=["run", "study", "hunt", "certificate"],
)
def test_who_asks_together_gets_each_their_own(ask, first, second):
    given = at_once(lambda: ask("name"))
    assert len(set(given)) == TOGETHER
    assert {first, second} <= set(map(str, given))
    assert all(path.exists() for path in given)


@pytest.mark.parametrize(
    ("ask", "refusal"),
    [
        (lambda out: outcome.prepare(plan_of("corridor"), out), "holds a run already"),
        (directories.for_hunt, "is there already"),
        (directories.for_certificate, "is there already"),
    ],
    ids=["run", "hunt", "certificate"],
)
def test_of_those_who_name_the_same_one_gets_it(ask, refusal, out):
    given = at_once(lambda: ask(out))
    refused = [one for one in given if isinstance(one, OSError)]
    assert len(refused) == TOGETHER - 1
    assert all(refusal in str(error) and "; name another" in str(error) for error in refused)


@pytest.mark.usefixtures("still")
def test_runs_in_the_same_second_all_fly():
    for _ in range(3):  # the second was told that the directory holds a run already
        assert main(["run", "corridor", *SHORT, "--json"]) == 0
    assert sorted(path.name for path in Path("runs").iterdir()) == [
        "corridor-20260101-000000",
        "corridor-20260101-000000-2",
        "corridor-20260101-000000-3",
    ]


@pytest.mark.parametrize("left", ["summary.json", "arrays", "run.rrd", "journal.arrows"])
def test_what_is_left_of_a_run_is_not_taken_for_this_one(left, out):
    out.mkdir()
    (out / left).touch()
    with pytest.raises(FileExistsError, match=f"holds a run already: {left}; name another directory"):
        fly(plan_of("corridor"), "inprocess", out, lambda *_: None)


def test_a_directory_with_files_of_others_is_flown_in(out):
    out.mkdir()
    (out / "notes.txt").touch()
    outcome.prepare(plan_of("corridor"), out)
    assert (out / "scenario.json").exists()


def test_a_study_is_not_written_over_another(out):
    assert report.prepare(out) == out
    (out / "claims.json").touch()
    with pytest.raises(FileExistsError, match="holds a study already; name another directory with --out"):
        report.prepare(out)


@pytest.mark.parametrize("make", [Path.mkdir, Path.touch], ids=["directory", "file"])
def test_what_was_claimed_in_vain_goes_again_and_what_holds_something_stays(make, tmp_path):
    with directories.unless_empty(tmp_path / "vain"):
        make(tmp_path / "vain")
    assert not (tmp_path / "vain").exists()
    (tmp_path / "full").write_text("found")
    with directories.unless_empty(tmp_path / "full"):
        pass
    assert (tmp_path / "full").read_text() == "found"
