"""Arrays on disk that grow: whole for whoever reads them, at whatever moment, and small in memory however long they are."""

import errno
import os

import numpy as np
import psutil
import pytest

from netem.processes.system_errors import said
from world.books import growing
from world.books.growing import GrowingArray, let_go, read

ROWS = np.arange(24.0).reshape(6, 2, 2)


@pytest.fixture
def array(tmp_path):
    growing = GrowingArray(tmp_path / "a.npy", ROWS)
    yield growing
    growing.close()


@pytest.fixture
def file(tmp_path):
    return tmp_path / "a.npy"


def test_it_is_an_array_of_numpy_at_every_moment(array, file):
    seen = [np.load(file)]
    for end in (2, 6):
        array.write(len(seen[-1]), ROWS[len(seen[-1]) : end])
        seen.append(np.load(file))
        array.declare(end)
        seen.append(np.load(file, mmap_mode="r"))
    assert [len(rows) for rows in seen] == [0, 0, 2, 2, 6]
    np.testing.assert_array_equal(seen[-1], ROWS)
    np.testing.assert_array_equal(read(file), ROWS)


def test_rows_may_be_written_again_and_are_converted(array, file):
    array.write(0, ROWS[:3].astype(np.int64))
    array.write(1, ROWS[3:5])
    array.declare(3)
    np.testing.assert_array_equal(read(file), ROWS[[0, 3, 4]])


def test_what_breaks_off_is_refused(array, file):
    array.write(0, ROWS)
    array.declare(6)
    os.truncate(file, file.stat().st_size - 1)
    with pytest.raises(ValueError, match="breaks off before its"):
        read(file)


@pytest.mark.parametrize("wanted", [True, False], ids=["wanted mapped", "large"])
def test_a_mapped_one_has_the_same_bits_and_is_not_written_to(wanted, array, file, monkeypatch):
    monkeypatch.setattr(growing, "_IN_MEMORY", 0)
    array.write(0, ROWS)
    array.declare(6)
    mapped = read(file, mapped=wanted)
    np.testing.assert_array_equal(mapped, ROWS)
    assert not mapped.flags.writeable
    let_go({"a": mapped[2:]})
    np.testing.assert_array_equal(mapped, ROWS)


def test_what_is_let_go_takes_no_memory(tmp_path):
    form = np.zeros((0, 2**17))
    array = GrowingArray(tmp_path / "large.npy", form)
    array.write(0, np.ones((64, 2**17)))  # 64 MiB
    array.declare(64)
    array.close()
    us, mapped = psutil.Process(), read(tmp_path / "large.npy", mapped=True)
    before = us.memory_info().rss
    total = mapped.sum()
    looked_at = us.memory_info().rss
    let_go({"large": mapped})
    assert total == 64 * 2**17
    assert looked_at - before > 2**25
    assert us.memory_info().rss - before < 2**24


def test_a_disk_that_is_full_leaves_what_was_there(array, file, monkeypatch):
    array.write(0, ROWS[:2])
    array.declare(2)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "pwrite", full)
    with pytest.raises(OSError, match="No space left") as caught:
        array.write(2, ROWS[2:])
    assert said(caught.value).startswith(f"'{file}': No space left on device; free some room")
    np.testing.assert_array_equal(read(file), ROWS[:2])


def test_what_the_system_writes_in_part_is_written_to_the_end(array, file, monkeypatch):
    whole = os.pwrite
    monkeypatch.setattr(os, "pwrite", lambda descriptor, data, place: whole(descriptor, data[:7], place))
    array.write(0, ROWS)
    array.declare(6)
    np.testing.assert_array_equal(read(file), ROWS)
