"""Which Pythons the matrix tries, what it says of them, and that it fails when one fails."""

import pytest

from tests.programs import pythons


def interpreter(folder, name, script):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(f"#!/bin/sh\n{script}\n")
    (folder / name).chmod(0o755)


def test_every_interpreter_of_the_path_and_of_pyenv_is_found_once_and_what_does_not_start_is_none(
    tmp_path, monkeypatch
):
    path, versions = tmp_path / "bin", tmp_path / "pyenv" / "versions"
    interpreter(path, "python3.10", "echo 3.10.1")
    interpreter(path, "python3.12", "echo 3.12.9")
    interpreter(path, "python3.12-config", "echo 3.12.9")
    interpreter(path, "python3.13", "exit 127")
    interpreter(versions / "3.12.1" / "bin", "python3.12", "echo 3.12.1")
    interpreter(versions / "3.13.0" / "bin", "python3.13", "echo 3.13.0")
    monkeypatch.setenv("PATH", f"{path}:{tmp_path / 'missing'}")
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path / "pyenv"))
    assert pythons.found() == {
        12: ("3.12.9", path / "python3.12"),
        13: ("3.13.0", versions / "3.13.0" / "bin" / "python3.13"),
    }


ALL = {minor: (f"3.{minor}.0", f"/python3.{minor}") for minor in (11, 12)}


@pytest.mark.parametrize(
    ("found", "failing", "status", "last"),
    [
        pytest.param(ALL, {}, 0, "Python 3.12.0: all passed", id="all pass"),
        pytest.param(ALL, {12: "demo"}, 1, "Python 3.12.0: demo FAILED", id="one fails"),
        pytest.param(ALL, {11: "set-up"}, 1, "Python 3.12.0: all passed", id="another fails"),
        pytest.param({11: ALL[11]}, {}, 0, "only one Python was found: no other was tried", id="only one"),
        pytest.param({}, {}, 1, "== Pythons tried", id="none"),
    ],
)
def test_it_says_which_were_tried_and_fails_when_one_failed(found, failing, status, last, monkeypatch, capsys):
    monkeypatch.setattr(pythons, "found", lambda: found)
    monkeypatch.setattr(pythons, "tried", lambda minor, _: failing.get(minor))
    assert pythons.main() == status
    said = capsys.readouterr()
    assert said.out.splitlines()[-1] == last
    assert all(f"Python {version}: {failing.get(minor, 'all')}" in said.out for minor, (version, _) in found.items())
    assert bool(said.err) == (not found)


def test_what_fails_first_is_named(monkeypatch):
    monkeypatch.setattr(pythons, "TESTS", ())
    assert pythons.tried(99, "/bin/false") == "environment"
