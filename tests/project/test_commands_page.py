"""docs/commands.md shows what is: every command is on it, and what it says they answer they do."""

import re

import pytest
from flying import PROCESSES
from pages import answered, is_answered, page, said

from affinet.cli import options
from affinet.cli.helping import commands_of
from affinet.scaffold import making

pytestmark = PROCESSES

PAGE = page("commands.md")
ANSWERED = answered(PAGE)


@pytest.mark.parametrize(("command", "shown"), ANSWERED, ids=[command for command, _ in ANSWERED])
def test_a_command_answers_what_the_page_shows(command, shown, tmp_path):
    _, told = said(command, tmp_path)
    assert is_answered(shown, told), told


def test_the_page_shows_enough():
    assert len(ANSWERED) >= 6


def test_every_command_is_on_the_page():
    table = PAGE.partition("| when | command |")[2].partition("\n\n")[0]
    named = set(re.findall(r"`(?:affinet )?([\w-]+)(?: --\w+)*`", table))
    assert named == set(commands_of(options.parser()))


def test_every_kind_of_scaffold_is_on_the_page():
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \|", PAGE.partition("## Begin with")[2], flags=re.MULTILINE)
    assert {kind for row in rows for kind in re.findall(r"\w+", row)} == set(making.KINDS)


@pytest.mark.parametrize("command", re.findall(r"^    (affinet schema .*)$", PAGE, flags=re.MULTILINE))
def test_a_command_of_the_page_passes(command, tmp_path):
    status, _ = said(command, tmp_path)
    assert status == 0
    assert list(tmp_path.glob("*.json"))
