"""docs/hardware.md shows what is: the columns of logs, the keys and messages of drivers, the words of the brief."""

from __future__ import annotations

import re
from dataclasses import Field, fields

import pytest
from paths import DOCS

from affinet.planning import csv_logs
from netem.wire import messages
from netem.wire.keys import Keys
from world.brief import DriverBrief

PAGE = (DOCS / "hardware.md").read_text(encoding="utf-8")


def test_the_table_has_the_columns_of_a_log() -> None:
    table = PAGE.partition("| column | what |")[2].partition("\n\n")[0]
    said = [
        name for row in table.splitlines() for name in re.findall(r"`(\w+)`", row.split("|")[1] if "|" in row else "")
    ]
    assert sorted(said) == sorted(csv_logs.columns_of(3))


@pytest.mark.parametrize("kind", [messages.Measured, messages.Command])
def test_messages_have_the_fields_that_it_says(kind: type[messages.Measured | messages.Command]) -> None:
    maps = [re.findall(r'"(\w+)"', said) for said in re.findall(r'`(\{"k".*?\})`', PAGE, flags=re.DOTALL)]
    assert any(set(kind.__struct_fields__) <= {*said} for said in maps)


@pytest.mark.parametrize("field", fields(DriverBrief))
def test_it_has_each_word_of_the_brief(field: Field[object]) -> None:
    assert f"`{field.name}`" in PAGE.partition("The brief:")[2]


def test_it_has_the_keys() -> None:
    keys = Keys("RUN")
    assert all(key.replace("RUN", "<run>") in PAGE for key in (keys.measured("<i>"), keys.command("<i>")))
