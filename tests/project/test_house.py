"""What the house says of itself is so: its picture, its pages, its docstrings, and what CI and pre-commit run."""

import importlib
import re
from collections.abc import Iterator
from typing import Any

import draw_house
import griffe
import pytest
import yaml
from paths import ROOT

from affinet.runtimes import told
from agents.brief import Brief
from agents.node import AgentBrief
from netem.wire import messages
from netem.wire.session import Login

PAGES = sorted(
    page
    for page in ROOT.rglob("*.md")
    if not any(part.startswith(".") or part == "runs" for part in page.relative_to(ROOT).parts)
)
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
AGAIN = "`make picture` draws it again"


def test_the_picture_is_that_of_the_imports():
    assert draw_house.PICTURE.read_text(encoding="utf-8") == draw_house.drawn(), AGAIN


def test_the_contracts_of_the_page_are_those_of_the_linter():
    assert draw_house.with_contracts(ARCHITECTURE) == ARCHITECTURE, AGAIN


def test_rooms_that_import_each_other_have_no_floors():
    assert draw_house.floors("abc", {("a", "b"): 1, ("a", "c"): 2, ("b", "c"): 3}) == {"c": 0, "b": 1, "a": 2}
    with pytest.raises(draw_house.Circle, match=r"in a circle, or above one: a, b$"):
        draw_house.floors("abc", {("a", "b"): 1, ("b", "a"): 1, ("b", "c"): 1})


def named(page: str) -> list[str]:
    """What a page names in code."""
    return re.findall(r"`([^`\n]+)`", page)


NAMES = sorted(
    {name for name in named(ARCHITECTURE) if re.fullmatch(r"(affinet|agents|world|netem|analysis)(\.\w+)+", name)}
)
PATHS = sorted({name for name in named(ARCHITECTURE) if re.fullmatch(r"[\w./-]+/[\w./-]*", name)})


@pytest.mark.parametrize("name", NAMES)
def test_what_the_page_names_is_there(name):
    found: Any = None
    for part in name.split("."):
        within = part if found is None else f"{found.__name__}.{part}"
        if found is None or (not hasattr(found, part) and hasattr(found, "__path__")):
            found = importlib.import_module(within)
        else:
            found = getattr(found, part)
    assert found is not None


@pytest.mark.parametrize("path", PATHS)
def test_where_the_page_points_to_is_there(path):
    assert (ROOT / path).exists()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_between_files_lead_somewhere(page):
    links = re.findall(r"\]\(([^)\s#]+)[^)]*\)", page.read_text(encoding="utf-8"))
    assert [link for link in links if "://" not in link and not (page.parent / link).exists()] == []


def test_the_page_names_enough():
    assert len(NAMES) > 40
    assert len(PATHS) > 20


def test_the_glossary_is_short_and_says_each_word():
    (table,) = re.findall(r"## Words\n\n\|.*\n\|-.*\n((?:\|.*\n)+)", ARCHITECTURE)
    assert len(table.splitlines()) <= 25
    words = re.findall(r"^\| ([^|]+) \|", table, flags=re.MULTILINE)
    assert {
        *[
            "tick",
            "clock",
            "carrier",
            "impairment",
            "medium",
            "relay",
            "verdict",
            "journal",
            "ledger",
            "accounts",
            "stress",
            "leader",
            "follower",
            "law",
        ],
        *["estimator", "Theta", "psi", "centre", "timeline", "fault", "verb", "bite", "vacuous", "claim"],
        *("link model", "in flight", "functional graph"),
    } <= {word for said in words for word in said.split(", ")}


TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))


def strings(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for each in value.values() if isinstance(value, dict) else value:
            yield from strings(each)


@pytest.mark.parametrize(
    "file", [".github/workflows/ci.yml", ".github/workflows/weekly.yml", ".pre-commit-config.yaml"]
)
def test_every_target_that_ci_and_hooks_make_exists(file):
    said = list(strings(yaml.safe_load((ROOT / file).read_text(encoding="utf-8"))))
    made = [target for text in said for target in re.findall(r"\bmake ([a-z-]+)", text)]
    assert made
    assert set(made) <= TARGETS


def test_ci_tries_the_wheel_and_every_python_that_is_promised():
    jobs = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))["jobs"]
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    promised = re.findall(r"Programming Language :: Python :: (3\.\d+)", project)
    assert jobs["test"]["strategy"]["matrix"]["python"] == promised
    assert jobs["test"]["continue-on-error"] == "${{ matrix.python == '3.14' }}"
    assert [step["run"] for job in ("test", "accuracy", "wheel") for step in jobs[job]["steps"] if "run" in step] == [
        "make test",
        "make accuracy",
        "make test-wheel",
    ]


def test_hooks_run_what_is_in_the_environment():
    (repo,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"]
    assert repo["repo"] == "local"
    assert [hook["id"] for hook in repo["hooks"]] == ["ruff", "ruff-format", "mypy", "import-linter"]
    assert all(hook["entry"].startswith((".venv/bin/", "make ")) for hook in repo["hooks"])


def test_every_target_says_what_it_is_for():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert [line for line in re.findall(r"^[a-z-]+:.*$", text, flags=re.MULTILINE) if "## " not in line] == []
    assert re.findall(r"^([a-z-]+):", text, flags=re.MULTILINE)[0] == "demo"  # what `make` alone does
    (phony,) = re.findall(r"^\.PHONY: (.*)$", text, flags=re.MULTILINE)
    assert set(phony.split()) == TARGETS


def prose(page: str) -> Iterator[tuple[int, str]]:
    """The lines of a page that wrap: none of code, and none that is a picture or a link alone; tables with a `|` in front."""
    fenced = before = False
    for number, line in enumerate(page.splitlines(), start=1):
        if line.startswith("```"):
            fenced = not fenced
        code = fenced or (line.startswith("    ") and before)
        before = not line.strip() or (before and code)
        if not code and not re.fullmatch(r"(!?\[[^]]*\]\([^)]*\)|\[[^]]+\]: .*)[.,]?", line.strip()):
            yield number, line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_line_of_a_page_needs_scrolling(page):
    lines = list(prose(page.read_text(encoding="utf-8")))
    assert [(number, len(line)) for number, line in lines if len(line) > 120 and not line.startswith("|")] == []


# The order of numpydoc, whose notes and references griffe calls admonitions.
ORDER = [
    "text",
    "parameters",
    "attributes",
    "returns",
    "yields",
    "receives",
    "other parameters",
    "raises",
    "warns",
    "admonition",
    "examples",
]


def of_the_house() -> Iterator[griffe.Class | griffe.Function]:
    loader = griffe.GriffeLoader(search_paths=[ROOT])
    for package in ("affinet", "agents", "world", "netem", "analysis"):
        yield from public(loader.load(package, submodules=True))


def public(holder: Any) -> Iterator[griffe.Class | griffe.Function]:
    for name, member in holder.members.items():
        if member.is_alias or (name.startswith("_") and not member.is_module):
            continue
        if member.is_class or member.is_function:
            yield member
        if member.is_class or member.is_module:
            yield from public(member)


def described(member: griffe.Class | griffe.Function) -> list[str]:
    """The parameters that a docstring describes; one entry may describe several."""
    sections = member.docstring.parse("numpy", warnings=False)
    return [
        name.strip().lstrip("*")
        for section in sections
        if section.kind.value == "parameters"
        for entry in section.value
        for name in entry.name.split(",")
    ]


def taken(member: griffe.Class | griffe.Function) -> list[str]:
    """The parameters that a function takes, or a class by its `__init__`; the fields of a named tuple."""
    function = member.members.get("__init__") if member.is_class else member
    if function is None:
        return [name for name, field in member.members.items() if field.is_attribute and "property" not in field.labels]
    names = [parameter.name.lstrip("*") for parameter in function.parameters if parameter.name not in ("self", "cls")]
    return [name for name in names if not name.startswith("_")] if member.is_class else names


def inherited(member: griffe.Class | griffe.Function) -> set[str]:
    """The fields of a record that its bases describe."""
    return set(taken(member)) - set(member.members) if member.is_class and "dataclass" in member.labels else set()


FEW = 3  # parameters that prose of a few lines can speak of without a section


def faults_of(member: griffe.Class | griffe.Function) -> Iterator[str]:
    if member.docstring is None:
        yield "has no docstring"
        return
    lines = member.docstring.value.splitlines()
    if not lines[0].strip() or (len(lines) > 1 and lines[1].strip()):
        yield "does not begin with one line of purpose"
    kinds = [ORDER.index(section.kind.value) for section in member.docstring.parse("numpy", warnings=False)]
    if kinds != sorted(set(kinds)):
        yield "has sections in another order than numpydoc's"
    says, takes = described(member), taken(member)
    if says and sorted({*says, *inherited(member)}) != sorted(takes):
        yield f"describes {says}, takes {takes}"
    if not says and member.is_function and len(lines) > 1 and len(takes) > FEW:
        yield f"has more than a line, and no section on {takes}"


@pytest.fixture(scope="module")
def members() -> list[griffe.Class | griffe.Function]:
    return list(of_the_house())


def test_every_public_docstring_is_numpydoc(members):
    assert len(members) > 1000
    assert [f"{member.path} {fault}" for member in members for fault in faults_of(member)] == []


WRONG = '''
def none(a): return a
def other(a, b):
    """Purpose.

    Parameters
    ----------
    a, c
        What.
    """
def disordered(a):
    """Purpose.

    Raises
    ------
    ValueError
        When.

    Parameters
    ----------
    a
        What.
    """
def many(a, b, c, d):
    """Purpose.

    And more.
    """
def late(a):
    """
    Purpose.
    """
class Fields:
    """Purpose.

    Parameters
    ----------
    a
        What.
    """
    a: int
    b: int = 0
'''


def test_docstrings_that_are_none_are_found(tmp_path):
    (tmp_path / "wrong.py").write_text(WRONG)
    found = griffe.GriffeLoader(search_paths=[tmp_path]).load("wrong")
    assert {name: [*faults_of(member)] for name, member in found.members.items()} == {
        "none": ["has no docstring"],
        "other": ["describes ['a', 'c'], takes ['a', 'b']"],
        "disordered": ["has sections in another order than numpydoc's"],
        "many": ["has more than a line, and no section on ['a', 'b', 'c', 'd']"],
        "late": [],
        "Fields": ["describes ['a'], takes ['a', 'b']"],
    }


PROTOCOL = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
OF_AN_AGENT = (AgentBrief, Login, Brief, messages.SenseInbox, messages.Broadcast, messages.ExchangeInbox, messages.Act)


@pytest.mark.parametrize("record", OF_AN_AGENT, ids=lambda record: record.__name__)
def test_the_protocol_names_every_field_that_an_agent_meets(record):
    unnamed = [name for name in record.__annotations__ if not re.search(rf"[`\"]{name}[`\"]", PROTOCOL)]
    assert not unnamed


def test_the_protocol_names_every_event_that_an_agent_may_tell():
    assert [event for event in told.MAY_SAY["agent"] if f'{{"event": "{event}"' not in " ".join(PROTOCOL.split())] == []
