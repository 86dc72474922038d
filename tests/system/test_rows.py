"""Every function over arrays gives a row of a batch, however that lies in memory, the bits that it gives the row alone."""

import ast
from pathlib import Path

import numpy as np
import pytest
from rows import agents_floor, analysis_floor, exempt, surface, world_floor
from rows.case import of, parted, real, share

import affinet
from analysis.models import elementary

CASES = {**analysis_floor.CASES, **world_floor.CASES, **agents_floor.CASES}
COVERED = {name.split(" ")[0] for name in CASES}
ROOT = Path(affinet.__file__).parents[1]


@pytest.mark.parametrize("name", CASES)
def test_a_row_alone_has_the_bits_of_a_row_of_a_batch(name):
    assert parted(name, CASES[name]) == []


def test_no_array_function_is_forgotten():
    flown = {name for name in surface.functions() if name.rpartition(".")[0] in surface.by_entry_point()}
    forgotten = set(surface.functions()) - COVERED - flown - set(exempt.NAMES)
    assert not forgotten, (
        f"give {sorted(forgotten)} a case in tests/helpers/rows, or a reason in tests/helpers/rows/exempt.py"
    )


def test_no_name_is_out_of_date_or_twice():
    assert COVERED | set(exempt.NAMES) <= set(surface.functions()) | {"netem.faults.lie.told"}  # of fields by name
    assert not COVERED & set(exempt.NAMES)
    assert len(exempt.NAMES) == len(set(exempt.NAMES))


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        (lambda x: x**2, (share(),)),
        (lambda matrix, vector: (matrix @ vector[..., None])[..., 0], (real(5, 5), real(5))),
        (lambda x: x.sum(axis=-1), (real(9, 9),)),
        (lambda x: x[..., [0, 3, 5, 4, 2, 7, 1, 6, 8]].sum(axis=-1), (real(9),)),
    ],
    ids=["a power", "a product", "a sum", "a sum after an index"],
)
def test_what_numpy_rounds_apart_is_noticed(function, arguments):
    assert parted("numpy", of(function, *arguments, rows=9000 if len(arguments[0].shape) == 0 else 17))


# Rounded by the C library or by code for some CPUs; analysis.models.elementary has those that are needed.
APART = {
    *(
        "power",
        "float_power",
        "exp",
        "exp2",
        "expm1",
        "log",
        "log2",
        "log10",
        "log1p",
        "logaddexp",
        "sin",
        "cos",
        "tan",
    ),
    *(
        "arcsin",
        "arccos",
        "arctan",
        "arctan2",
        "sinh",
        "cosh",
        "tanh",
        "hypot",
        "cbrt",
        "matmul",
        "dot",
        "inner",
        "vdot",
    ),
}
# A colour scale; a margin of error in a label; nothing of a flight.
PICTURES = {("analysis/figures/curves.py", "log10"), ("analysis/figures/target.py", "**")}


def _apart(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id in ("np", "math") and node.attr in APART:
                yield node.attr
        elif isinstance(node, ast.BinOp):
            constant = isinstance(node.left, ast.Constant) and isinstance(node.right, ast.Constant | ast.UnaryOp)
            if isinstance(node.op, ast.Pow) and not constant:
                yield "**"
            if isinstance(node.op, ast.MatMult):
                yield "@"


EXACT = {ROOT / "analysis" / "models" / name for name in ("algebra.py", "elementary.py")}


def test_nothing_that_flies_calls_what_rounds_apart():
    files = {file for floor in surface.FLOORS for file in (ROOT / floor).rglob("*.py")} - EXACT
    found = {(str(file.relative_to(ROOT)), what) for file in files for what in _apart(file)}
    assert len(files) > 80
    assert found - PICTURES == ONCE


# Before a flight, once, by whoever plans it.
ONCE = {("world/formation/stress.py", "@"), ("analysis/models/graph.py", "**")}


@pytest.mark.parametrize(
    ("function", "exact", "arguments", "units"),
    [
        (elementary.exp, np.exp, (np.linspace(-700.0, 700.0, 9999),), 1),
        (elementary.expm1, np.expm1, (np.linspace(-2.0, 2.0, 9999),), 3),
        (elementary.log, np.log, (np.geomspace(1e-300, 1e300, 9999),), 1),
        (elementary.log, np.log, (np.linspace(0.5, 2.0, 9998),), 1),
        (elementary.sin, np.sin, (np.linspace(-1e4, 1e4, 9999),), 2),
        (elementary.cos, np.cos, (np.linspace(-1e4, 1e4, 9998),), 2),
        (elementary.hypot, np.hypot, (np.geomspace(1e-300, 1e300, 9999), np.geomspace(1e-290, 1e290, 9999)), 2),
        (elementary.arctan2, np.arctan2, (np.sin(np.linspace(-9, 9, 9999)), np.cos(np.linspace(-8, 9, 9999))), 2),
        (elementary.power, np.power, (np.linspace(0.0, 3.0, 9999), 0.75), 8),
        (elementary.whole_power, np.power, (np.linspace(-3.0, 3.0, 9999), 3), 2),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_elementary_functions_are_as_good_as_those_of_c(function, exact, arguments, units):
    wanted = exact(*arguments)
    assert (np.abs(function(*arguments) - wanted) <= units * np.spacing(np.abs(wanted))).all()


def test_where_elementary_functions_end():
    ends = np.array([-np.inf, -800.0, -0.0, 0.0, 800.0, np.inf, np.nan])
    with np.errstate(all="ignore"):
        for function in ("exp", "expm1", "log"):
            np.testing.assert_array_equal(getattr(elementary, function)(ends), getattr(np, function)(ends))
        y, x = np.meshgrid(ends, ends)
        found, wanted = elementary.arctan2(y, x), np.arctan2(y, x)
        np.testing.assert_allclose(found, wanted, rtol=1e-15)
        told = ~np.isnan(wanted)
        np.testing.assert_array_equal(np.signbit(found[told]), np.signbit(wanted[told]))
    np.testing.assert_array_equal(elementary.power([0.0, 0.0, 2.0], [0.0, 0.5, 0.0]), [1.0, 0.0, 1.0])
    assert elementary.hypot(1e308, 1e308) == np.hypot(1e308, 1e308)
    assert np.isnan(elementary.sin([np.inf, np.nan])).all()
