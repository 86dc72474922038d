"""Each row of the table of accuracy is not ok where the air is not what was asked for."""

import json
from dataclasses import replace

import accuracy
import arriving
import composed
import flown
import independent
import late
import lossy
import numpy as np
import pytest
import queued
from against import Against
from paths import DOCS
from scipy import stats

from netem.impairments.corrupt import Mark
from netem.impairments.loss import bernoulli, gilbert_elliott
from netem.medium.in_flight import Verdicts
from netem.medium.verdict import Verdict

VERDICTS = 1_000_000
HONEST = flown.medium


def flying(monkeypatch, check, planted, verdicts=VERDICTS, seed=1):
    """The rows of a check, by what they say, of a medium that was told other impairments than were asked for."""

    def medium(seed, links, channels=flown.ONE, faults=(), **impairments):
        return HONEST(seed, links, channels, faults, **planted(links, impairments))

    monkeypatch.setattr(flown, "medium", medium)
    return list(check(verdicts, seed))


def not_ok(rows):
    return {row.what for row in rows if not row.ok}


def off_by_one_percent(links, on):
    """Every message that may pass is lost in one case more of a hundred."""
    extra = flown.layers(links, bernoulli(0.01))[0]
    return on | {"chains": (*on["chains"], replace(extra, lane=9))}


def longer_bursts(links, on):
    """Bursts a tenth longer, as often lost."""
    lasting = gilbert_elliott(0.02 / 1.1, 0.25 / 1.1)
    return on | {"chains": (*on["chains"][:-1], *flown.layers(links, bernoulli(0.0), lasting)[1:])}


def one_tick_more(_, on):
    delays = tuple(replace(law, mean=law.mean + flown.DT) for law in on.get("delays", ()))
    traces = tuple(replace(trace, seconds=trace.seconds + flown.DT) for trace in on.get("delay_traces", ()))
    return on | ({"delays": delays} if delays else {"delay_traces": traces})


def one_percent_slower(_, on):
    limits = {name: replace(on[name], rate=0.99 * on[name].rate) for name in ("rate", "rate_trace") if name in on}
    return on | limits


def one_percent_more_corrupted(_, on):
    return on | {"corrupt": on["corrupt"] + 0.01 * (on["corrupt"] > 0.0)}


def one_percent_more_copies(_, on):
    return on | {"duplicate": on["duplicate"] + 0.01}


PLANTED = {
    "losses": (composed._losses, off_by_one_percent, {"mean loss", "burst lengths", "mean burst"}),
    "bursts": (composed._delay_behind_losses, longer_bursts, {"burst lengths", "mean burst"}),
    "a loss alone": (
        lambda verdicts, seed: lossy._chain(lossy.CASES[0], verdicts, seed),
        off_by_one_percent,
        {"mean loss", "burst lengths", "mean burst", "mean age"},
    ),
    "a delay alone": (
        lambda verdicts, seed: late._delay(late.CASES[6], verdicts, seed),
        one_tick_more,
        {"arrive before they are due, or a tick late"},
    ),
    "copies alone": (late._duplicates, one_percent_more_copies, {"share"}),
    "corruption alone": (late._corruption, one_percent_more_corrupted, {"stale", "bias", "nan", "bit-flip", "kinds"}),
    "draws that channels share": (
        independent._ticks_and_channels,
        lambda _, on: on | {"coupled": True},
        {"of sense and input", "of sense and theta", "of input and theta"},
    ),
    "a trace": (
        composed._losses_and_a_trace,
        off_by_one_percent,
        {f"mean loss while the trace says {share}" for share in ("1", "0.6", "0.9")},
    ),
    "a queue": (
        composed._queue_behind_bursts,
        one_percent_slower,
        {"verdicts other than computed again", "due in other ticks", "mean wait, ticks", "waits, ticks"},
    ),
    "delays": (
        composed._delay_behind_losses,
        one_tick_more,
        {"ticks of those that pass", "ticks of the first after a burst"},
    ),
    "ages": (composed._age, one_tick_more, {"mean age of the newest, ticks", "share older than 5 ticks"}),
    "copies": (composed._copies_of_the_corrupted, one_percent_more_copies, {"copies"}),
    "corruption": (
        lambda verdicts, seed: composed._copies_of_the_corrupted(verdicts // 4, seed),
        one_percent_more_corrupted,
        {f"{kind} among all that arrives" for kind in ("stale", "bias", "bit-flip")},
    ),
    "delays over time": (
        composed._delay_over_time,
        one_tick_more,
        {"ticks other than the file says", "mean ticks beyond the file's"},
    ),
    "losses beside delays over time": (composed._delay_over_time, off_by_one_percent, {"loss"}),
    "rates over time": (
        composed._rate_over_time,
        one_percent_slower,
        {"due in other ticks", "of so many that waited"},
    ),
}


@pytest.mark.parametrize("name", PLANTED)
def test_impairments_together_that_are_not_what_was_asked_for_are_found(monkeypatch, name):
    check, planted, found = PLANTED[name]
    assert found <= not_ok(flying(monkeypatch, check, planted))


def test_two_messages_that_are_swapped_are_found(monkeypatch):
    arrivals = composed._arrivals

    def swapped(air, ticks):
        newest, rows = arrivals(air, ticks)
        rows[[1000, 2000], 0] = rows[[2000, 1000], 0]
        return newest, rows

    monkeypatch.setattr(composed, "_arrivals", swapped)
    assert not_ok(composed._copies_of_the_corrupted(100_000, 1)) == {"arrivals other than the verdicts say"}


def test_a_row_has_what_was_requested_in_its_interval_or_is_not_ok():
    against = Against("planted", "")
    hits = np.arange(1000) < 250
    for share in np.linspace(0.2, 0.3, 101):
        row = against.share("share", share, hits)
        low, high = map(float, row.interval.split(" to "))
        assert row.ok == (low <= share <= high)
    each = np.array([1.0, 2.0, 3.0, 4.0])
    low, high = map(float, against.mean("mean", 2.5, each).interval.split(" to "))
    inside = stats.ttest_1samp(each, 0.0).confidence_interval(1.0 - 2.0 * stats.norm.sf(3.0))
    assert (low, high) == pytest.approx((inside.low, inside.high), rel=1e-4)


def test_tables_are_kept_beside_their_page(tmp_path, monkeypatch):
    page, file = tmp_path / "accuracy.md", tmp_path / "accuracy.json"
    marks = "".join(
        f"<!-- {name}: written by bench/accuracy.py -->\n<!-- end of {name} -->\n" for name in accuracy.TABLES
    )
    page.write_text(f"# A page\n{marks}the end\n", encoding="utf-8")
    for only in ("loss", "composed"):  # of the first table that is a part
        options = ["--verdicts", "50000", "--seed", "2", "--only", only, "--keep", str(file)]
        monkeypatch.setattr("sys.argv", ["accuracy.py", *options])
        assert accuracy.main() == 0
    assert [*json.loads(file.read_text(encoding="utf-8"))] == ["composed"]
    said = page.read_text(encoding="utf-8")
    assert said.startswith("# A page\n")
    assert said.endswith("the end\n")
    assert "\n| queue behind bursts | " in said
    assert "; 50,000 verdicts, seed 2, " in said


def test_the_page_has_the_tables_that_were_kept():
    page, kept = ((DOCS / f"accuracy.{kind}").read_text(encoding="utf-8") for kind in ("md", "json"))
    tables = json.loads(kept)
    assert {*tables} == {*accuracy.TABLES}
    assert all(row["ok"] and row["file"] for table in tables.values() for row in table["rows"])
    assert accuracy.laid(page, tables) == page
    tables["models"]["seed"] += 1
    assert accuracy.laid(page, tables) != page
    with pytest.raises(ValueError, match="the page has no place for its table"):
        accuracy.laid("# A page", tables)


def test_messages_that_arrive_are_compared_one_by_one_and_as_often_as_they_come():
    rows = np.array([[3, 1, 0, 2, 0], [3, 1, 0, 2, 0], [4, 4, 0, 1, 2]])
    assert arriving.apart(rows, rows[::-1]) == 0
    assert arriving.apart(rows, rows[1:]) == 1
    assert arriving.apart(rows, rows + np.array([0, 0, 0, 0, 1])) == 6


def test_what_arrives_of_verdicts_is_late_stale_twice_or_not_at_all():
    kind = np.array([Verdict.DELIVERED, Verdict.DELAYED, Verdict.LOST, Verdict.DELAYED], dtype=np.uint8)
    made = Verdicts(
        kind[:, None, None],
        np.array([0, 3, 2, 9])[:, None, None],
        np.array([0, Mark.STALE, 0, 0], dtype=np.uint8)[:, None, None],
        np.array([2, -1, -1, 3])[:, None, None],
    )
    arrives = [[0, 0, 0, 0, 0], [3, 0, 0, 0, Mark.STALE], [2, 0, 0, 0, 0], [3, 3, 0, 0, 0]]
    assert arriving.apart(arriving.expected(made), np.array(arrives)) == 0


def test_a_queue_by_hand():
    passing = np.array([True, True, True, False, True])[:, None, None]
    overflow, due = queued.queued(passing, np.array([2, 0, 0, 5, 5, 5, 5]), sizes=[3], room=5)
    assert overflow.ravel().tolist() == [False, False, True, False, False]
    assert due[passing & ~overflow].tolist() == [4, 4, 5]
