"""In a checkout the rooms lie beside `affinet`, and a user's module may have the name of one: one line says which."""

import subprocess
import sys
from pathlib import Path

import pytest

import affinet

ROOT = Path(affinet.__file__).parents[1]
SHADOWS = {"agents": "agents/__init__.py", "world": "world.py", "analysis": "analysis.py", "netem": "netem.py"}
HARMLESS = ["agents/notes.txt", "worlds.py"]  # a folder without __init__.py gives way to a package


@pytest.fixture
def project(tmp_path):
    """Makes a project with these files."""

    def make(*files):
        for file in files:
            (tmp_path / file).parent.mkdir(exist_ok=True)
            (tmp_path / file).write_text("raise RuntimeError('it was imported')\n")
        return tmp_path

    return make


def python(folder, *arguments):
    return subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False)


def line(folder, room):
    """What is said of a module of a room's name."""
    return f"{folder / SHADOWS[room]} comes before affinet's own {ROOT / room}: rename it, "


@pytest.mark.parametrize("room", SHADOWS)
def test_the_command_says_so_in_one_line(room, project):
    folder = project(SHADOWS[room])
    done = python(folder, "-m", "affinet", "check", "corridor")
    assert done.returncode == 2
    (said,) = done.stderr.splitlines()
    assert said.startswith(line(folder, room))
    assert said.endswith(f"pip install {ROOT}")


@pytest.mark.parametrize("name", ["run", "Estimate", "bounded", "scenario"])
def test_so_does_every_name_of_the_library(name, project):
    folder = project(SHADOWS["world"])
    done = python(folder, "-c", f"import affinet; affinet.{name}")
    assert done.stderr.splitlines()[-1].startswith(f"affinet.rooms.RoomShadowed: {line(folder, 'world')}")


def test_the_plugin_says_so_of_tests_that_fly_and_lets_others_be(project):
    folder = project(SHADOWS["agents"])
    (folder / "test_mine.py").write_text(
        "def test_flies(swarm):\n    swarm('corridor')\n\ndef test_other():\n    pass\n"
    )
    done = python(folder, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    assert "1 passed, 1 error" in done.stdout
    assert line(folder, "agents") in done.stdout
    assert "Traceback" not in done.stdout


def test_a_test_file_that_imports_from_affinet_cannot_be_collected_and_says_so(project):
    folder = project(SHADOWS["agents"])
    (folder / "test_mine.py").write_text("from affinet import bounded\n")
    done = python(folder, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    assert done.returncode == 2
    (said,) = [one for one in done.stdout.splitlines() if one.startswith("E ")]
    assert f"RoomShadowed: {line(folder, 'agents')}" in said
    assert "affinet/__init__.py" not in done.stdout


def test_a_module_that_was_imported_in_place_of_a_room_is_found_too(project):
    folder = project("worlds.py")
    (folder / "elsewhere").mkdir()
    (folder / "elsewhere" / "world.py").write_text("")
    program = "import sys; sys.path.insert(0, 'elsewhere'); import world; del sys.path[0]; import affinet; affinet.run"
    done = python(folder, "-c", program)
    assert f"{folder / 'elsewhere' / 'world.py'} comes before" in done.stderr


def test_what_takes_the_place_of_nothing_is_let_be(project):
    done = python(project(*HARMLESS), "-m", "affinet", "check", "corridor")
    assert done.returncode == 0, done.stderr
