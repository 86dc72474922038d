"""docs/reference/ is what the models and docstrings say, and they say something of everything."""

from dataclasses import replace

import pytest
import references
from marked import parameters

from affinet.reference import catalogue
from affinet.reference.entries import Entry, Parameter

ENTRIES = [
    entry for kind in ("verbs", "checkers", "impairments", "estimators", "laws") for entry in catalogue.KINDS[kind]()
]


@pytest.mark.parametrize("page", references.PAGES)
def test_a_page_is_what_the_script_writes(page):
    written = (references.FOLDER / f"{page}.md").read_text(encoding="utf-8")
    assert written == references.text(page), "run `python docs/references.py`"


def test_there_are_no_other_pages():
    assert {file.stem for file in references.FOLDER.glob("*.md")} == {*references.PAGES}


def untold(entries):
    """What is there without a line."""
    return [entry.name for entry in entries if not entry.says] + [
        f"{entry.name}.{one.name}" for entry in entries for one in entry.parameters if not one.says
    ]


def test_everything_is_told_in_a_line():
    assert untold(ENTRIES) == []


def test_what_is_not_told_is_found():
    (mute,) = (replace(entry, says="") for entry in ENTRIES if entry.name == "cut")
    assert untold([mute, Entry("b", "says", (Parameter("c", "text", True, None, "", ""),))]) == ["cut", "b.c"]


def test_a_bar_in_a_cell_parts_no_columns():
    *_, row = parameters([Parameter("a", "text", False, 1, "", "either | or")])
    assert row == r"| `a` | text | `1` | either \| or |"
