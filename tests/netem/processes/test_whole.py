"""A file is the old one or the new one, whole, and nothing is left beside it."""

import pytest

from netem.processes.whole import whole


@pytest.fixture
def file(tmp_path):
    (tmp_path / "a.npz").write_text("old")
    return tmp_path / "a.npz"


def test_what_is_written_takes_the_place_of_what_was_there_when_it_is_done(file):
    with whole(file) as unfinished:
        unfinished.write_text("new")
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    assert list(file.parent.iterdir()) == [file]


def test_what_fails_on_the_way_leaves_what_was_there_and_nothing_else(file):
    def fail():
        with whole(file) as unfinished:
            unfinished.write_text("ne")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert file.read_text() == "old"
    assert list(file.parent.iterdir()) == [file]


def test_a_file_of_the_same_kind_is_written_meanwhile(file):  # NumPy would append what is missing
    with whole(file) as unfinished:
        assert unfinished.suffix == file.suffix
        unfinished.touch()
