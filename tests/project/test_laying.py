"""The wheel: rooms laid within `affinet`, and no name taken that others may have."""

import ast
import zipfile

import laying
import pytest

from tests.programs import wheel

MODULES = {"agents.brief", "netem", "netem.core.links", "world"}
LAID = [
    ("from agents.brief import Own\n", "from affinet.agents.brief import Own\n"),
    ("from netem import core\n", "from affinet.netem import core\n"),
    ("import netem\n", "import affinet.netem as netem\n"),
    ("import netem, os\n", "import affinet.netem as netem, os\n"),
    ("import world as truth, netem\n", "import affinet.world as truth, affinet.netem as netem\n"),
    ("import netem.core.links as links\n", "import affinet.netem.core.links as links\n"),
    (
        "é = 1; from  world import a; import agents\n",
        "é = 1; from  affinet.world import a; import affinet.agents as agents\n",
    ),
    (
        "def f():\n    from agents.brief import (\n        Own,\n    )\n",
        "def f():\n    from affinet.agents.brief import (\n        Own,\n    )\n",
    ),
]
AS_THEY_ARE = [
    "import affinet\n",
    "from affinet.cli import show\n",
    "from worlds import netem\n",
    "from . import agents\n",
    "import os, numpy as world\n",
    "# from agents import x\n",
    'role = "world"; key = "agents.estimator"; text = "from agents.brief import Own"\n',
    '"""As `agents.brief` says."""\n',
]
REFUSED = [
    (
        "x = 1\nimport netem.core.links\n",
        r"a\.py:2: write `from netem\.core import links` for `import netem\.core\.links`",
    ),
    ("from \\\n  agents.brief import Own\n", r"a\.py:1: write `from agents\.brief` on one line"),
    ('load("agents.brief")\n', r"a\.py:1: 'agents\.brief' names a module: take its __name__ instead"),
    ('load("agents.brief:Own")\n', r"a\.py:1: 'agents\.brief:Own' names a module"),
]


@pytest.mark.parametrize(("source", "laid"), LAID)
def test_imports_of_rooms_are_from_within(source, laid):
    assert laying.imports_within(source.encode(), MODULES, "a.py").decode() == laid
    ast.parse(laid)


@pytest.mark.parametrize("source", AS_THEY_ARE)
def test_nothing_else_changes(source):
    assert laying.imports_within(source.encode(), MODULES, "a.py").decode() == source


@pytest.mark.parametrize(("source", "says"), REFUSED)
def test_what_cannot_be_laid_is_said(source, says):
    with pytest.raises(laying.CannotBeLaid, match=says):
        laying.imports_within(source.encode(), MODULES, "a.py")


def test_the_whole_repository_can_be_laid():
    files = [file for room in (*laying.ROOMS, "affinet") for file in (wheel.ROOT / room).rglob("*.py")]
    modules = {".".join(file.relative_to(wheel.ROOT).with_suffix("").parts) for file in files}
    assert len(files) > 200
    for file in files:
        laid = ast.parse(laying.imports_within(file.read_bytes(), modules, file.name))
        froms = {node.module or "" for node in ast.walk(laid) if isinstance(node, ast.ImportFrom)}
        imported = {alias.name for node in ast.walk(laid) if isinstance(node, ast.Import) for alias in node.names}
        assert not {name for name in froms | imported if name.partition(".")[0] in laying.ROOMS}


def test_entry_points_are_from_within_and_nothing_else_of_the_project():
    points = {"affinet.laws": {"rest": "agents.laws.single:Rest"}, "pytest11": {"affinet": "affinet.testing.plugin"}}
    said = {"name": "affinet", "scripts": {"affinet": "affinet.__main__:command"}, "entry-points": points}
    laid = laying.project_within({"project": said, "build-system": {"requires": []}})["project"]
    assert laid["entry-points"]["affinet.laws"] == {"rest": "affinet.agents.laws.single:Rest"}
    assert {key: laid[key] for key in ("name", "scripts")} == {key: said[key] for key in ("name", "scripts")}
    assert laid["entry-points"]["pytest11"] == points["pytest11"]


def planted(folder, *names):
    """A wheel with these files."""
    file = folder / "affinet-0.1.0-py3-none-any.whl"
    with zipfile.ZipFile(file, "w") as archive:
        for name in ("affinet/__init__.py", "affinet-0.1.0.dist-info/METADATA", *names):
            archive.writestr(name, "")
    return file


@pytest.mark.parametrize("name", ["agents/__init__.py", "world.py", "affinet.py", "affinet_agents/brief.py"])
def test_a_wheel_that_takes_another_name_fails_the_script(name, tmp_path, capsys):
    assert wheel.strangers(planted(tmp_path)) == set()
    assert wheel.main([str(planted(tmp_path, name))]) == 1
    taken = name.partition("/")[0]
    assert f"the wheel FAILED: affinet-0.1.0-py3-none-any.whl takes the names {taken}" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_wheel_is_a_good_neighbour(capsys):
    assert wheel.main([]) == 0, capsys.readouterr().err
