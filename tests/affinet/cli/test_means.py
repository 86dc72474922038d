"""Tables of means: whole where a terminal is narrow, and of a study no longer than one reads."""

import io

import pytest
from rich.console import Console

from affinet.cli import means
from affinet.cli.means import Row
from affinet.studies import record

KEYS = ("network.availability", "agents.estimator", "agents.parameters.rkf.sigma_w")
NUMBERS = (0.85961, 0.097741, 1.6214)


def shown(rows, width):
    page = io.StringIO()
    means.show(Console(file=page, width=width), rows, "m²", intervals=True)
    return [line.strip() for line in page.getvalue().splitlines() if line.strip()]


@pytest.mark.parametrize("keys", [KEYS[:1], KEYS[:2], KEYS])
def test_at_80_columns_words_and_numbers_are_whole(keys):
    rows = [Row(dict.fromkeys(keys, "ga-rkf"), *NUMBERS, "10 pass") for _ in range(3)]
    lines = shown(rows, 80)
    assert max(map(len, lines)) <= 80
    assert [line for line in lines if "…" in line] == []
    assert sum("0.8596" in line and "0.09774 to 1.621" in line and "10 pass" in line for line in lines) == 3
    assert all(part in "\n".join(lines) for key in keys for part in key.split("."))


def test_names_stay_on_a_line_where_there_is_room():
    rows = [Row(dict.fromkeys(KEYS, "ga-rkf"), *NUMBERS, "10 pass")]
    assert any(all(key in line for key in KEYS) for line in shown(rows, 160))


def test_a_study_says_the_means_of_its_cases_and_where_the_rest_is(tmp_path, capsys):
    full = record.full_study("bursts")
    means.of_study(full, tmp_path)
    out = capsys.readouterr().out
    first, *_, last = out.splitlines()
    assert first == "tracking error, mean over 50 runs of each case; 99 % interval by Student's t"
    assert sum("zhao7" in line for line in out.splitlines()) == 24
    assert f"{full.cases[0].found:.4g}" in out
    assert last == f"{tmp_path / 'claims.json'} has {len(full.cases) - 24} cases more"


def test_other_quantities_of_a_study_are_named(tmp_path, capsys):
    means.of_study(record.full_study("paper-004-fig46"), tmp_path)
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.endswith(
        "claims.json has rate by which the Procrustes error falls, change of a step from the one before"
    )


@pytest.mark.parametrize(
    ("quantity", "low", "warned"),
    [
        ("error", -1.0, True),
        ("error", 0.5, False),
        ("error", None, False),
        ("fall", -1.0, False),
        ("report:x", -1.0, False),
    ],
)
def test_an_interval_below_nothing_is_warned_of(quantity, low, warned, capsys):
    means.warn(Console(), quantity, [Row({"loss": "0.5"}, 1.0, low, 3.0)])
    assert ("few runs make the mean" in capsys.readouterr().out) == warned
