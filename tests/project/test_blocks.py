"""Every block of the docs is what it is said to be: commands that affinet takes, Python that compiles, TOML that parses.

Those that show what comes of them are run by the tests of their pages; none is left to be read by people alone.
"""

import ast
import contextlib
import io
import re
import shlex
import tomllib

import pytest
from pages import PAGES, blocks
from paths import DOCS, ROOT

import affinet
from affinet.cli import options
from affinet.runtimes.machines.hosts import Hosts
from affinet.scenario.sections import Scenario
from affinet.score.card import Scorecard
from affinet.studies import study

PARTS = {*Scenario.model_fields, *study.Study.model_fields, *Hosts.model_fields}


def commands(language, block):
    """What is typed for affinet in it, with lines that go on joined."""
    if language in ("", "sh", "bash", "text"):
        lines = re.sub(r"\\\n\s*", "", block).splitlines()
        answered = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
        for line in answered or lines:
            yield from re.findall(r"^(?:cd \S+ && )?(affinet [a-z-].*)", line)


def wrong_command(typed):
    """What the command line says of it, or nothing; brackets and what stands behind a pipe or a sign are not of it."""
    words = [word for word in shlex.split(typed, comments=True) if word != "..."]
    for sign in ("|", ">", "&&", "||", "&"):
        words = words[: words.index(sign)] if sign in words else words
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        try:
            options.parser().parse_args(words[1:])
        except SystemExit as end:
            return said.getvalue() if end.code else ""
    return ""


def wrong_python(block):
    """What it takes from affinet and affinet does not have; a block that does not compile raises."""
    tree = ast.parse(re.sub(r"^(>>> |\.\.\. )", "", block, flags=re.MULTILINE))
    taken = {
        name.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "affinet"
        for name in node.names
    }
    taken |= {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "affinet"
    }
    return sorted(taken - set(affinet.__all__))


def wrong_toml(block):
    """Keys of the first order that neither scenarios nor studies have, where it is of one of them; scorecards are whole."""
    keys = set(says := tomllib.loads(block))
    if "tasks" in keys:
        Scorecard.model_validate(says)
        return []
    return sorted(keys - PARTS) if keys & PARTS else []


EVERY = [(page, *block) for page in PAGES for block in blocks(page.read_text(encoding="utf-8"))]
TYPED = [(str(page.relative_to(ROOT)), typed) for page, *block in EVERY for typed in commands(*block)]


def of(language):
    return [
        pytest.param(block, id=f"{page.relative_to(ROOT)}-{number}")
        for number, (page, its, block) in enumerate(EVERY)
        if its == language
    ]


def test_every_command_of_the_docs_is_one():
    assert len(TYPED) > 100
    wrong = {f"{page}: {typed}": said for page, typed in TYPED if (said := wrong_command(typed))}
    assert wrong == {}


@pytest.mark.parametrize("block", of("python"))
def test_python_of_the_docs_compiles_and_takes_what_there_is(block):
    assert wrong_python(block) == []


@pytest.mark.parametrize("block", of("toml"))
def test_toml_of_the_docs_parses_and_has_keys_that_there_are(block):
    assert wrong_toml(block) == []


def test_what_is_wrong_is_found():
    assert wrong_command("affinet fly corridor")
    assert wrong_command("affinet run corridor --estimater rkf")
    assert not wrong_command("affinet run corridor --json > out.json  # all of it")
    assert wrong_python("import affinet\naffinet.fly()\nfrom affinet import run, walk") == ["fly", "walk"]
    assert wrong_toml("[formation]\n[manouvre]") == ["manouvre"]
    with pytest.raises(ValueError, match="airs"):
        wrong_toml("[[tasks]]")
    found = list(blocks("a\n\n    affinet run x\n\n```python\nb\n```\n"))
    assert found == [("python", "b\n"), ("", "affinet run x\n")]


PICTURES = sorted((DOCS / "pictures").iterdir())
SCRIPTS = "".join(script.read_text(encoding="utf-8") for script in DOCS.glob("*.py"))


@pytest.mark.parametrize("picture", PICTURES, ids=lambda picture: picture.name)
def test_every_picture_is_on_a_page_and_made_by_a_script(picture):
    assert any(picture.name in page.read_text(encoding="utf-8") for page in PAGES)
    assert any(picture.stem.startswith(name) for name in study.shipped()) or made(picture)


def made(picture):
    """Whether a script names it, or the kind of it."""
    return picture.stem in SCRIPTS or f"{picture.stem.partition('-')[0]}-{{" in SCRIPTS
