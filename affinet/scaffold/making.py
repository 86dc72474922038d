"""What is written for each kind of scaffold: all of it, or nothing where something is there already."""

from __future__ import annotations

import builtins
import json
import keyword
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any

from affinet.reference import schema
from affinet.runtimes import directories
from affinet.scenario.wrong import ScenarioError

_NAME = re.compile(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*")
_SCHEMAS: Mapping[str, Callable[[], dict[str, Any]]] = {
    schema.SCENARIO_FILE: schema.scenario,
    schema.STUDY_FILE: schema.study,
}
_TEMPLATE_OF = {"Filter": "estimator.py.template", "Law": "law.py.template"}
_PYTEST = "python -m pytest"  # that of this environment, whichever is first on the path
_INSTALL_PYTEST = "python -m pip install pytest"
_SHIPPED = {"estimator": "ga-rkf", "law": "varying-velocity"}


@dataclass(frozen=True)
class Scaffold:
    """What is written, and what one does with it next.

    Parameters
    ----------
    files
        Templates by the file that each becomes.
    says
        What stands for words in them, beside the name.
    schemas
        Files of schemas that lie beside them.
    then
        Command lines, from the folder in which they are typed.
    module
        Whether its name is that of a module.
    """

    files: Mapping[str, str]
    says: Mapping[str, str]
    schemas: tuple[str, ...]
    then: tuple[str, ...]
    module: bool = False


def _algorithm(key: str, word: str) -> Scaffold:
    """A module of one, which has this key in scenarios; its class stands for a word in the template."""
    return Scaffold(
        {"$module.py": f"{key}.py", "$module.toml": "scenario.toml", "test_$module.py": "test_flown.py"},
        _SHIPPED | {key: "$module:$Class", word: "$Class"},
        (schema.SCENARIO_FILE,),
        (f"{_PYTEST} test_$module.py", "affinet run $module.toml"),
        module=True,
    )


KINDS: Mapping[str, Scaffold] = {
    "scenario": Scaffold(
        {"$module.toml": "scenario.toml"},
        _SHIPPED,
        (schema.SCENARIO_FILE,),
        ("affinet check $module.toml", "affinet run $module.toml --runtime inprocess"),
    ),
    "estimator": _algorithm("estimator", "Filter"),
    "law": _algorithm("law", "Law"),
    "study": Scaffold(
        {"$module.toml": "study.toml"},
        {"scenario": "corridor"},
        (schema.STUDY_FILE,),
        ("affinet study $module.toml --quick",),
    ),
    "test": Scaffold({"test_$module.py": "test_faults.py"}, {}, (), (f"{_PYTEST} test_$module.py",)),
    "project": Scaffold(
        {
            "$name/README.md": "project/README.md",
            "$name/pyproject.toml": "project/pyproject.toml",
            "$name/swarm.toml": "scenario.toml",
            "$name/study.toml": "study.toml",
            "$name/$module/__init__.py": "project/init.py",
            "$name/$module/estimator.py": "estimator.py",
            "$name/$module/law.py": "law.py",
            "$name/tests/test_swarm.py": "project/test_swarm.py",
        },
        {
            "estimator": "$module.estimator:${Class}Filter",
            "Filter": "${Class}Filter",
            "law": "$module.law:${Class}Law",
            "Law": "${Class}Law",
            "scenario": "swarm.toml",
        },
        (f"$name/{schema.SCENARIO_FILE}", f"$name/{schema.STUDY_FILE}"),
        ("cd $name", _PYTEST, "affinet run swarm.toml"),
        module=True,
    ),
}


def make(kind: str, name: str, folder: Path) -> tuple[list[Path], list[str]]:
    """Write a scaffold; returns the files, and what one does next.

    Parameters
    ----------
    kind
        One of `KINDS`.
    name
        Of it.
    folder
        Where.

    Raises
    ------
    ScenarioError
        When it cannot be called so.
    OSError
        When something of it is there already, or cannot be written.
    """
    scaffold = KINDS[kind]
    words = _words(name, kind)
    files = {folder / path: text for path, text in _texts(scaffold, words)}
    if taken := [path for path in files if path.exists()]:
        raise FileExistsError(f"{str(taken[0])!r} is there already, and nothing was written; choose another name")
    if scaffold.module:
        _refuse_taken(words["module"])
        _refuse_hidden(scaffold, words)
    for path, text in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        directories.new_file(path, text)
    for place in scaffold.schemas:
        path = folder / Template(place).substitute(words)
        if not path.exists():  # it is that of this affinet, or the user's own
            files[path] = json.dumps(_SCHEMAS[path.name](), indent=1) + "\n"
            directories.new_file(path, files[path])
    return list(files), [Template(line).substitute(words) for line in _with_pytest(scaffold.then)]


def _with_pytest(then: Sequence[str]) -> list[str]:
    """What one does next, with pytest to be installed where it is called and is not there."""
    missing = find_spec("pytest") is None and any(line.startswith(_PYTEST) for line in then)
    return [_INSTALL_PYTEST, *then] if missing else list(then)


def _words(name: str, kind: str) -> dict[str, str]:
    if not _NAME.fullmatch(name):
        raise ScenarioError(f"{name!r} is no name: give small letters, figures and dashes, like my-{kind}")
    written = name.replace("-", "_")
    return {"name": name, "module": written, "Class": "".join(part.capitalize() for part in written.split("_"))}


def _refuse_taken(module: str) -> None:
    if keyword.iskeyword(module):
        raise ScenarioError(f"{module} is a word of Python: choose another name, like my-{module}")
    if find_spec(module) is not None:
        raise ScenarioError(f"{module} is a module already: choose another name, like my-{module}")


def _refuse_hidden(scaffold: Scaffold, words: Mapping[str, str]) -> None:
    """Refuse a class that is a word of Python, or would hide a name that its own file uses."""
    templates = resources.files("affinet.scaffold") / "templates"
    for word in scaffold.says.keys() & {"Filter", "Law"}:
        name = Template(scaffold.says[word]).substitute(words)
        text = (templates / _TEMPLATE_OF[word]).read_text(encoding="utf-8")
        if keyword.iskeyword(name) or hasattr(builtins, name) or re.search(rf"(?<![$\w]){name}\b", text):
            raise ScenarioError(
                f"its class would be {name}, which is taken: choose another name, like my-{words['name']}"
            )


def _texts(scaffold: Scaffold, words: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    says = {word: Template(text).substitute(words) for word, text in scaffold.says.items()}
    templates = resources.files("affinet.scaffold") / "templates"
    for path, template in scaffold.files.items():
        text = (templates / f"{template}.template").read_text(encoding="utf-8")
        yield Template(path).substitute(words), Template(text).substitute(words, **says)
