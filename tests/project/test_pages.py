"""The pages that are worked through: all that stands on them is done, in one folder, and says what they show."""

import re
import shlex
import tomllib

import pytest
from flying import PROCESSES
from pages import Step, Wrong, is_answered, page, said, steps, work_through
from paths import ROOT

from affinet.cli import options
from affinet.cli.helping import commands_of
from affinet.planning import registry
from affinet.scaffold import making
from affinet.scenario.profiles import IMPAIRMENTS

pytestmark = PROCESSES

# Commands that are not typed here, and what does it.
ELSEWHERE = {
    "installing.md": {},
    "launch.md": {},
    "laws.md": {},
    "traces.md": {},
    "tutorial.md": {},
}


@pytest.mark.timeout(1200)  # a page is a session of many commands
@pytest.mark.parametrize("name", ELSEWHERE)
def test_a_page_says_what_happens(name, tmp_path):
    text, elsewhere = page(name), ELSEWHERE[name]
    done = work_through(text, tmp_path, elsewhere)
    assert len(done) >= 3
    assert {step.what for step in steps(text)} - {step.what for step in done} == set(elsewhere)


@pytest.mark.parametrize(("name", "section"), [("network.md", "Jammed zones")])
def test_a_section_says_what_happens(name, section, tmp_path):
    _, _, text = page(name).partition(f"\n## {section}\n")
    assert len(work_through(text.partition("\n## ")[0], tmp_path, {})) >= 3


def typed(text):
    """Commands of affinet that stand on a page without an answer: in a line of their own, or in the text."""
    lines = re.findall(r"^    (affinet .*?)(?: +#.*)?$", text, re.MULTILINE)
    return {*lines, *(" ".join(command.split()) for command in re.findall(r"(?<!`)`(affinet [a-z][^`]*)`", text))}


@pytest.mark.parametrize("command", sorted({command for name in ELSEWHERE for command in typed(page(name))}))
def test_what_stands_without_an_answer_can_be_typed(command):
    _, *words = shlex.split(command)
    if words[1:] in ([], ["--dask"]):  # a command by its name
        assert words[0] in commands_of(options.parser())
    else:
        assert options.parser().parse_args(words)


def test_a_scaffolded_project_offers_what_the_page_says(tmp_path):
    making.make("project", "my-swarm", tmp_path)
    (shown,) = re.findall(r"```toml\n(.*?)```", page("installing.md"), re.DOTALL)
    written = tomllib.loads((tmp_path / "my-swarm" / "pyproject.toml").read_text())["project"]["entry-points"]
    assert tomllib.loads(shown)["project"]["entry-points"] == written
    rows = re.findall(r"^\| `(affinet\.\w+)` \|", page("installing.md"), re.MULTILINE)
    assert rows == [registry.ESTIMATORS, registry.LAWS, IMPAIRMENTS]


def test_the_extras_are_those_there_are():
    rows = re.findall(
        r"^\| `(\w+)` \|", page("installing.md").partition("| extra |")[2].partition("\n\n")[0], re.MULTILINE
    )
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(rows) == set(project["optional-dependencies"])
    assert f"wheels/affinet-{project['version']}-py3-none-any.whl" in page("installing.md")


@pytest.mark.slow
@pytest.mark.parametrize("command", re.findall(r"- run: ((?:affinet|pytest).*)", page("installing.md")))
def test_what_ci_runs_passes_in_a_scaffolded_project(command, tmp_path):
    making.make("project", "my-swarm", tmp_path)
    status, told = said(f"{command} -p no:cacheprovider" if "pytest" in command else command, tmp_path / "my-swarm")
    assert status == 0, told


# ---- how they are read


TEXT = """
```python
# one.py: a file
print("one")
```

```python
# one.py, at its end: more
two = 2
```

```python
import one
print(one.two)
```

```text
one
2
```

    $ python -c 'import one; raise SystemExit(3)'
    one
    $ echo $?
    3

Text, and a command that does not run:

    affinet watch runs/one
    $ true
"""


def test_a_page_is_worked_through(tmp_path):
    assert steps(TEXT) == [
        Step('# one.py: a file\nprint("one")\n', "", "one.py"),
        Step("# one.py, at its end: more\ntwo = 2\n", "", "one.py", more=True),
        Step("import one\nprint(one.two)\n", "one\n2\n", program=True),
        Step("python -c 'import one; raise SystemExit(3)'", "    one\n"),
        Step("echo $?", "    3\n"),
        Step("true", ""),
    ]
    assert len(work_through(TEXT, tmp_path, {})) == 6
    assert len(work_through(TEXT, tmp_path, {"true": "nobody"})) == 5


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("one\n2\n```", "one\n3\n```"),
        ("    one\n", "    two\n"),
        ("    3\n", "    0\n"),
        ("    $ echo $?\n    3\n", ""),
        ("$ true", "$ false"),
    ],
)
def test_what_a_page_says_wrongly_is_found(right, wrong, tmp_path):
    assert right in TEXT
    with pytest.raises(Wrong):
        work_through(TEXT.replace(right, wrong), tmp_path, {})


def test_what_is_not_answered_is_found():
    told = "one\ntwo\nthree\n"
    assert is_answered("    one\n    ...\n    three\n", told)
    assert is_answered("    two\n    three\n", told)
    assert is_answered("    one\n    t...\n", told)
    assert not is_answered("    one\n    three\n", told)
    assert not is_answered("    one\n    x...\n", told)
    assert not is_answered("    three\n    ...\n    one\n", told)
