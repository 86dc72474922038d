"""Tables in parts of bounded size: one table for who reads them from the first, and each a table by itself."""

import pyarrow as pa
import pytest

from netem.core import arrow
from netem.core.arrow import Stream, TableError, read, scan
from netem.core.parts import part, parts

SCHEMA = pa.schema([("tick", pa.int32()), ("who", arrow.NAMES), ("says", pa.string())])
SMALL = 3000  # bytes


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.setattr(arrow, "LARGEST", SMALL)
    return tmp_path / "book.arrows"


def written(path, batches):
    stream = Stream(path, SCHEMA)
    for number in range(batches):
        ticks = list(range(100 * number, 100 * number + 100))
        names = arrow.named([tick % 2 for tick in ticks], ["odd", "even"])
        stream.write({"tick": ticks, "who": names, "says": [None] * 99 + [str(number)]}, {"batches": number + 1})
    stream.close()


def test_parts_are_numbered_from_the_second_on(tmp_path):
    path = tmp_path / "run.rrd"
    for number in (1, 2, 4):
        part(path, number).touch()
    assert [file.name for file in parts(path)] == ["run.rrd", "run-2.rrd"]


def test_what_is_long_is_in_parts_of_bounded_size_that_are_one_table(path):
    written(path, 40)
    files = parts(path)
    assert len(files) > 3
    assert all(file.stat().st_size < 2 * SMALL for file in files)
    assert read(path, SCHEMA)["tick"].to_pylist() == list(range(4000))


def test_each_part_is_a_table_by_itself(path):
    written(path, 40)
    own = [pa.ipc.open_stream(file.read_bytes()).read_all() for file in parts(path)]
    assert sum(table.num_rows for table in own) == 4000
    assert own[2]["who"].to_pylist()[:2] in (["odd", "even"], ["even", "odd"])
    assert read(parts(path)[1], SCHEMA)["tick"].to_pylist() == own[1]["tick"].to_pylist()


@pytest.mark.parametrize("left", [0, 20], ids=["nothing yet", "half a schema"])
def test_who_is_killed_where_a_part_begins_leaves_those_before(left, path):
    written(path, 40)
    last = parts(path)[-1]
    before = sum(pa.ipc.open_stream(file.read_bytes()).read_all().num_rows for file in parts(path)[:-1])
    last.write_bytes(last.read_bytes()[:left])
    assert read(path, SCHEMA).num_rows == before


def test_one_column_may_be_read_alone_with_the_notes(path):
    written(path, 40)
    found = [(batch.schema.names, batch["says"][-1].as_py(), note) for batch, note in scan(path, SCHEMA, "says")]
    assert found == [(["says"], str(number), {"batches": number + 1}) for number in range(40)]


def test_a_table_of_other_columns_is_refused(path):
    written(path, 1)
    with pytest.raises(TableError, match="its columns are"):
        read(path, pa.schema([("tick", pa.int32())]))
    with pytest.raises(TableError, match="no such table"):
        read(path.with_name("none.arrows"), SCHEMA)
