"""The journal: every verdict a row, streamed to disk as Arrow. How it judges another run is in `recorded.py`.

The file is an Arrow stream, so what a killed run has written can be read. Which rows there are of a tick is in `rows.py`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from netem.core import arrow
from netem.core.arrow import NAMES, Stream, named
from netem.core.links import Links
from netem.core.plain import from_plain
from netem.faults.fault import Fault
from netem.impairments.corrupt import Mark
from netem.medium.entry import Entry
from netem.medium.ledger import NOTHING, Accounts, Ledger
from netem.medium.rows import VERDICTS, Rows, rows_of
from netem.medium.verdict import Verdict, VerdictCodes
from netem.processes import system_errors

_DELAYED, _DROPPED, _COPIED, _RELEASED = map(VERDICTS.index, ("delayed", "dropped", "copied", "released"))
_REASON = np.array([kind.label for kind in Verdict])
_MARK = np.array([mark.label for mark in Mark])

SCHEMA = pa.schema(
    [
        ("tick", pa.int32()),
        ("src", pa.int32()),
        ("dst", pa.int32()),
        ("channel", NAMES),
        ("seq", pa.int32()),
        ("verdict", NAMES),
        ("reason", NAMES),
        ("deliver_tick", pa.int32()),
        ("mark", NAMES),
        ("event", pa.string()),
        ("transport", pa.string()),
    ]
)
_ALWAYS = ("tick", "src", "dst", "channel", "seq", "verdict")  # what each row has
_LEAST = {"tick": 0, "src": 1, "dst": 1, "seq": 0}


class JournalError(ValueError):
    """What is wrong with a journal."""


class Writer:
    """Writes the journal of a run, and with it the accounts so far; what is entered is written when it is closed at the latest.

    Parameters
    ----------
    path
        Of the file.
    links, channels
        What the rows of the verdicts stand for.
    batch
        How many ticks are written at once.

    Raises
    ------
    OSError
        By all its methods: when something cannot be written, from the first byte to the last.
    """

    def __init__(self, path: Path, links: Links, channels: Sequence[str], batch: int) -> None:
        self._path = path
        self._links = links
        self._channels = list(channels)
        self._offered = np.zeros((len(channels), len(links)), dtype=np.int64)
        self._batch = batch
        self._entered: list[Entry] = []
        self._transport: dict[int, Mapping[str, int]] = {}
        self.accounts = NOTHING
        with system_errors.about(path):
            self._stream = Stream(path, SCHEMA)

    def __enter__(self) -> Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with system_errors.afterwards(self.close):
            if error is not None:
                raise error

    def enter(self, entry: Entry, in_flight: int, lost: Mapping[str, int] = MappingProxyType({})) -> None:
        """Write down the next tick, after which so many messages are under way.

        Parameters
        ----------
        entry, in_flight
            What was decided in it, and how many are under way.
        lost
            How many messages the transport is known by now to have lost, by key, beside all verdicts: they were had again.
        """
        if lost:
            self._transport[self.accounts.ticks + len(self._entered)] = lost
        self._entered.append(entry)
        self._in_flight = in_flight
        if len(self._entered) == self._batch:
            self._write()

    def close(self) -> None:
        """Write what is left, and end the file."""
        with system_errors.about(self._path), system_errors.afterwards(self._stream.close):
            self._write()

    def _write(self) -> None:
        if not self._entered:
            return
        entries, self._entered = self._entered, []
        first, verdicts = self.accounts.ticks, np.stack([entry.verdicts for entry in entries])
        ledger = self.accounts.ledger.plus(_ledger(verdicts, entries))
        self.accounts = Accounts(first + len(entries), ledger, self._in_flight)
        written, self._offered = rows_of(first, verdicts, entries, self._offered)
        events = {first + n: entry.injected for n, entry in enumerate(entries) if entry.injected is not None}
        transport, self._transport = self._transport, {}
        with system_errors.about(self._path):
            beside = {"event": _beside(written, events), "transport": _beside(written, transport)}
            self._stream.write(self._table(written) | beside, self.accounts)

    def _table(self, written: Rows) -> dict[str, Any]:
        return {
            "tick": written.tick,
            "src": self._links.src[written.link],
            "dst": self._links.dst[written.link],
            "channel": named(written.channel, self._channels),
            "seq": written.seq,
            "verdict": named(written.verdict, VERDICTS),
            "reason": named(written.kind, _REASON, written.kind < Verdict.DEAD),
            "deliver_tick": pa.array(written.deliver_tick, pa.int32(), mask=written.deliver_tick < 0),
            "mark": named(written.mark, _MARK, written.mark == Mark.NONE),
        }


def _beside(written: Rows, said: Mapping[int, Any]) -> Any:
    """A column that says something of ticks, in the first row of each."""
    column = np.full(len(written.tick), None, dtype=object)
    column[np.searchsorted(written.tick, list(said))] = [json.dumps(of_tick) for of_tick in said.values()]
    return column


def _ledger(verdicts: VerdictCodes, entries: Sequence[Entry]) -> Ledger:
    return Ledger.of(
        verdicts=verdicts,
        copies=np.array([entry.copies for entry in entries]),
        late=np.array([entry.late for entry in entries]),
        dropped=np.stack([entry.dropped_by_verdict for entry in entries]),
    )


def read(path: Path) -> Any:
    """The journal as a pyarrow table, as far as it was written.

    Raises
    ------
    JournalError
        When it is no journal.
    """
    try:
        table = arrow.read(path, SCHEMA)
    except arrow.TableError as error:
        raise JournalError(str(error)) from error
    if wrong := _damage(table, told(path).accounts):
        raise JournalError(f"{path}: it is damaged: {wrong}")
    return table


def _damage(table: Any, booked: Accounts | None) -> str | None:
    """What no journal that a run has written says."""
    if empty := [name for name in _ALWAYS if table[name].null_count]:
        return f"it has rows without {', '.join(empty)}"
    if below := [name for name, least in _LEAST.items() if table[name].to_numpy().min(initial=least) < least]:
        return f"{', '.join(below)} cannot be negative, or that of nobody"
    last = int(table["tick"].to_numpy().max(initial=-1))
    if last >= (0 if booked is None else booked.ticks):
        return f"it has verdicts of tick {last}, of which its accounts know nothing"
    return None


class Told(NamedTuple):
    """What a journal says beside its verdicts.

    Parameters
    ----------
    accounts
        Of the run, as far as its journal was written; None where it holds no tick.
    injected
        The faults that were injected into the run while it flew.
    """

    accounts: Accounts | None
    injected: tuple[Fault, ...]


def told(path: Path) -> Told:
    """What a journal says beside its verdicts, of whose rows no more than one batch is held at a time.

    Raises
    ------
    JournalError
        When it is no journal, or what it says is none of that.
    """
    accounts, injected = None, None
    try:
        for batch, note in arrow.scan(path, SCHEMA, "event"):
            accounts = note or accounts
            events = batch["event"].drop_null()
            injected = events[-1].as_py() if len(events) else injected
    except arrow.TableError as error:
        raise JournalError(str(error)) from error
    except ValueError as error:
        raise JournalError(f"its accounts cannot be read: {error}") from error
    with _refusing("accounts"):
        booked = None if accounts is None else from_plain(Accounts, accounts)
    with _refusing("faults"):
        faults = () if injected is None else tuple(from_plain(Fault, fault) for fault in json.loads(injected))
    return Told(booked, faults)


def lost(table: Any) -> dict[int, dict[str, int]]:
    """Messages that the transport lost between machines, and that were had again: by tick, and by key.

    Raises
    ------
    JournalError
        When they are none.
    """
    said = table.select(["tick", "transport"]).filter(table["transport"].is_valid())
    with _refusing("losses"):
        counts = [json.loads(counts) for counts in said["transport"].to_pylist()]
        return dict(zip(said["tick"].to_pylist(), counts, strict=True))


@contextmanager
def _refusing(what: str) -> Iterator[None]:
    """What cannot be read in the block is what was written beside the verdicts."""
    try:
        yield
    except (ValueError, TypeError, RecursionError) as error:
        raise JournalError(f"its {what} cannot be read: {error}") from error
