"""Each line of the threat model names its test, and each test of an attack stands in it."""

import ast
import re

import pytest
from paths import ROOT

PAGE = ROOT / "docs" / "trust.md"
ATTACKS = "tests/netem/wire/test_trust.py"


def lines(page):
    (table,) = re.findall(r"^\| who \|.*?\n\|[-|]+\|\n(.*?)\n\n", page, flags=re.DOTALL | re.MULTILINE)
    return table.splitlines()


def named(line):
    """The tests that a line names: file and function."""
    places = re.findall(r"`([\w/.:]*test_\w+)`", line.rpartition("| ")[2])
    return [tuple(place.split("::")) if "::" in place else (ATTACKS, place) for place in places]


def written(file):
    return {node.name for node in ast.walk(ast.parse((ROOT / file).read_text())) if isinstance(node, ast.FunctionDef)}


def without_test(page):
    return [line for line in lines(page) if not (tests := named(line)) or any(t not in written(f) for f, t in tests)]


def not_on(page):
    known = {test for line in lines(page) for _, test in named(line)}
    return {name for name in written(ATTACKS) if name.startswith("test_")} - known


def test_each_line_of_the_threat_model_names_a_test_that_is_there():
    page = PAGE.read_text()
    assert len(lines(page)) > 20
    assert not without_test(page)
    assert not not_on(page)


@pytest.mark.parametrize(
    "there", ["test_nobody_looks_into_the_hub", "test_a_run_asked_to_end_leaves_a_summary_and_no_secrets"]
)
def test_a_test_that_is_gone_is_missed(there):
    page = PAGE.read_text()
    assert len(without_test(page.replace(there, "test_of_nothing"))) == 1
    assert not_on(page.replace("test_nobody_looks_into_the_hub", "")) == {"test_nobody_looks_into_the_hub"}
