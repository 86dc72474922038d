"""The arrays of a run in its directory: those of the run, tick by tick, however it ended."""

import os
from contextlib import suppress

import numpy as np
import pytest
from flying import plan_of
from kept_arrays import rewrite

from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.rehearsing import rehearse
from world.books import growing, history
from world.books.archive import UNBEGUN, Archive
from world.books.history import ARRAYS, Damaged, History, by_span, digest, load

PLAN = plan_of("localization", "time.duration=0.3")
OF_A_RUN = (PLAN.world, len(PLAN.channels), PLAN.reports)


@pytest.fixture(scope="module")
def flown():
    """Batches of a flight, with where each of them led."""
    batches = []
    InProcessSwarm(PLAN).fly(lambda *batch: batches.append(batch), 7)
    return batches


@pytest.fixture
def folder(tmp_path):
    return tmp_path / ARRAYS


def of_the_first(batches):
    kept = History(*OF_A_RUN)
    for batch in batches:
        kept.extend(*batch)
    return kept.arrays()


def alike(one, other):
    assert one.keys() == other.keys()
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name], strict=True)


def test_after_every_batch_all_of_it_is_there(flown, folder):
    with Archive(folder, *OF_A_RUN) as archive:
        for number, batch in enumerate(flown, start=1):
            archive.extend(*batch)
            alike(load(folder), of_the_first(flown[:number]))
    assert digest(load(folder)) == digest(load(folder, mapped=True)) == digest(rehearse(PLAN).arrays)


def test_until_the_first_batch_nothing_is_there(flown, folder, monkeypatch):
    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(growing.GrowingArray, "declare", killed)
    with Archive(folder, *OF_A_RUN) as archive, pytest.raises(KeyboardInterrupt):
        archive.extend(*flown[0])
    assert [path.name for path in folder.parent.iterdir()] == [ARRAYS + UNBEGUN]
    with pytest.raises(FileNotFoundError):
        load(folder)


@pytest.mark.parametrize("step", range(1, 40))
def test_killed_at_any_step_of_a_batch_those_before_are_there(step, flown, folder, monkeypatch):
    """Whatever was written of a batch, it is there in all arrays or in none."""
    left = [step]

    def then_killed(method):
        def stepping(*given):
            left[0] -= 1
            if not left[0]:
                raise KeyboardInterrupt
            method(*given)

        return stepping

    with Archive(folder, *OF_A_RUN) as archive:
        for batch in flown[:2]:
            archive.extend(*batch)
        for name in ("write", "declare"):
            monkeypatch.setattr(growing.GrowingArray, name, then_killed(getattr(growing.GrowingArray, name)))
        with suppress(KeyboardInterrupt):
            archive.extend(*flown[2])
    found = load(folder)
    alike(found, of_the_first(flown[: 2 if len(found["error"]) == 14 else 3]))


def test_of_a_long_run_some_arrays_may_be_wanted(flown, folder):
    with Archive(folder, *OF_A_RUN) as archive:
        archive.extend(*flown[0])
    assert list(load(folder, only=["place", "input"])) == ["place", "input"]


def test_a_report_of_any_name_is_a_file():
    assert history.file_of("a/b ü") == "a%2Fb%20%C3%BC.npy"


def test_spans_are_all_of_it_with_where_the_last_tick_led(flown, monkeypatch):
    monkeypatch.setattr(history, "_SPAN", 8)
    arrays = of_the_first(flown)
    spans = list(by_span(arrays))
    assert [len(span["error"]) for span in spans] == [8, 8, 8, 6]
    alike({name: np.concatenate([span[name] for span in spans]) for name in arrays}, arrays)
    assert [len(span["error"]) for span in by_span({name: array[:0] for name, array in arrays.items()})] == [0]


def test_a_digest_is_that_of_the_whole_whatever_the_span(flown, monkeypatch):
    whole = digest(of_the_first(flown))
    monkeypatch.setattr(history, "_SPAN", 4)
    assert digest(of_the_first(flown)) == whole


def test_other_files_are_no_arrays_and_a_damaged_one_is_named(flown, folder):
    rewrite(folder, of_the_first(flown))
    (folder / "notes.txt").write_text("mine")
    load(folder)
    os.truncate(folder / "psi.npy", 200)
    with pytest.raises(Damaged, match=r"psi\.npy: not what a run wrote there: it breaks off"):
        load(folder)
