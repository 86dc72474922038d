"""What the pages have a reader type is there after `make demo`, and what somebody installed beside it stays."""

import ast
import re
import shlex
import subprocess
import sys
import tomllib
from importlib import metadata

import pytest
from packaging.requirements import Requirement
from pages import PAGES, blocks
from paths import ROOT

GROUPS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
ROOMS = {"affinet", "agents", "analysis", "netem", "world"}
# Typed by who changes affinet itself, in the environment of `make test`; on another page that stands beside the command.
DEVELOPERS = {ROOT / "CONTRIBUTING.md"}
SAID = "make test"


def environment(makefile):
    """The distributions that `make demo` installs, by their names: of affinet, and of the groups that its rule names."""
    (sync,) = re.findall(r"\$\(UV\) sync (?=.*--no-dev)(?!.*--group browser).*", makefile)
    wanted = [line for group in re.findall(r"--group (\w+)", sync) for line in GROUPS[group]]
    found, todo = set(), [Requirement(line) for line in [*(metadata.requires("affinet") or []), *wanted]]
    while todo:
        one = todo.pop()
        if one.marker and not any(one.marker.evaluate({"extra": extra}) for extra in {"", *one.extras}):
            continue
        if (name := one.name.lower()) not in found:
            found.add(name)
            todo += [Requirement(line) for line in metadata.requires(name) or []]
    return found


def scripts(names):
    """The commands of distributions."""
    every = ((one.metadata["Name"].lower(), one.entry_points) for one in metadata.distributions())
    return {point.name for name, points in every if name in names for point in points.select(group="console_scripts")}


def imported(file):
    """The modules that a program of the repository imports, itself or by others beside it."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module}
    tops = {name.partition(".")[0] for name in names}
    beside = {top for top in tops if (file.parent / f"{top}.py").exists()}
    return (tops - beside).union(*(imported(file.parent / f"{top}.py") for top in beside))


def strangers(file, names):
    """What a program imports that no distribution of these brings."""
    brings = metadata.packages_distributions()
    outside = imported(file) - ROOMS - set(sys.stdlib_module_names)
    return {top for top in outside if top in brings and not names & {one.lower() for one in brings[top]}}


def typed(text):
    """Lines that are typed on a page, with the paragraph in which each stands, or the one before its block."""
    for paragraph in text.split("\n\n"):
        yield from ((line, paragraph) for line in re.findall(r"`(python [\w/]+\.py[^`]*)`", paragraph))
    for language, block in blocks(text):
        if language in ("", "sh", "bash"):
            before = text[: text.find(block.splitlines()[0])].rstrip().rpartition("\n\n")[2]
            yield from ((line.removeprefix("$ "), before) for line in block.splitlines())


def missing(text, names):
    """What is typed on a page and is not there with these distributions alone."""
    others = (
        scripts({one.metadata["Name"].lower() for one in metadata.distributions()})
        - scripts(names)
        - {"affinet", "pip"}
    )
    for line, said in typed(text):
        words = line.split("#")[0].split()
        program = re.match(r"python ([\w/]+\.py)", line)
        lacks = strangers(ROOT / program[1], names) if program and (ROOT / program[1]).exists() else set()
        lacks |= {words[0]} & others if words else set()
        if lacks and SAID not in said:
            yield f"{line}: {', '.join(sorted(lacks))}"


@pytest.mark.parametrize("page", sorted({*PAGES} - DEVELOPERS), ids=lambda page: str(page.relative_to(ROOT)))
def test_what_is_typed_is_there_after_the_demo(page):
    assert list(missing(page.read_text(encoding="utf-8"), environment(MAKEFILE))) == []


def test_what_is_not_there_is_found():
    without = environment(MAKEFILE.replace("--group pages ", ""))
    assert "pytest" not in without
    assert environment(MAKEFILE) >= {"pytest", "numpy", "rerun-sdk"}
    assert list(missing("Text.\n\n    $ pytest -q test_mine.py\n", without)) == ["pytest -q test_mine.py: pytest"]
    (line,) = missing("`python docs/run_notebooks.py` executes.\n", environment(MAKEFILE))
    assert "nbclient" in line
    assert list(missing("After `make test`, `python docs/run_notebooks.py` executes.\n", without)) == []


def test_a_readers_pytest_takes_our_settings(tmp_path):
    """It has no plugins, and our settings are strict: an option that it does not know would end it."""
    (tmp_path / "test_one.py").write_text("def test_one(): pass\n")
    bare = ["-p", "no:timeout", "-p", "no:xdist", "-p", "no:cacheprovider"]
    told = [sys.executable, "-m", "pytest", *bare, "-c", str(ROOT / "pyproject.toml"), "test_one.py"]
    done = subprocess.run(told, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_no_rule_takes_away_what_somebody_installed():
    syncs = [shlex.split(line) for line in re.findall(r"\$\(UV\) (sync .*)", MAKEFILE)]
    ours = [words for words in syncs if "browser" not in words]  # in an environment of its own
    assert len(ours) >= 3
    assert [words for words in ours if "--inexact" not in words] == []
