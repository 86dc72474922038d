"""Bytes carried by key over Zenoh: the one place that knows it. Everybody else hears, says, asks and answers."""

from __future__ import annotations

import json
import queue
import threading
from collections.abc import Callable, Iterable, Mapping
from types import TracebackType
from typing import Any

import zenoh

from netem.wire import reasons
from netem.wire.session import CONTROL, Login, client, identity

_WAITING_CHANGES = 4
_WAITING_ENTRANTS = 1024
_LEAST_ROOM, _TICKS = 1024, 4  # for messages of those who may flood


class NotCarried(RuntimeError):
    """Nobody can be reached, or nobody answers: why."""


class StrangerEntered(RuntimeError):
    """Somebody has opened a session by the proof of a process of the run, and is not it: who."""


class Arrived:
    """Bytes that arrived, and the key they arrived on."""

    def __init__(self, sample: zenoh.Sample) -> None:
        self._sample = sample

    @property
    def key(self) -> str:
        """The key."""
        return str(self._sample.key_expr)

    @property
    def size(self) -> int:
        """How many bytes there are; nothing is copied for it."""
        return len(self._sample.payload)

    @property
    def data(self) -> bytes:
        """The bytes."""
        return self._sample.payload.to_bytes()

    @property
    def note(self) -> bytes:
        """What came beside them."""
        return b"" if self._sample.attachment is None else self._sample.attachment.to_bytes()


class Ear:
    """Hears what is said on a key."""

    def __init__(self, subscriber: Any) -> None:
        self._subscriber = subscriber

    def next(self) -> Arrived:
        """Wait for the next message, in the order of their arrival."""
        return Arrived(self._subscriber.recv())

    def waiting(self) -> list[Arrived]:
        """All that has arrived and was not asked for yet, in that order."""
        arrived = []
        while (sample := self._subscriber.try_recv()) is not None:
            arrived.append(Arrived(sample))
        return arrived


class Ears:
    """Hears several keys at once, for whoever has a time to keep."""

    def __init__(self) -> None:
        self._samples: queue.SimpleQueue[zenoh.Sample | None] = queue.SimpleQueue()
        self._urgent: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()

    def take(self, sample: zenoh.Sample) -> None:
        """Something has arrived."""
        self._samples.put(sample)

    def take_first(self, sample: zenoh.Sample) -> None:
        """Something has arrived for which all else is to wait."""
        self._urgent.put(sample)
        self._samples.put(None)  # who waits for anything is to look

    def next(self, patience_s: float | None) -> Arrived | None:
        """The next message on any of them, if one comes within so many seconds; None waits for ever."""
        try:
            while self._urgent.empty():
                if (sample := self._samples.get(timeout=patience_s)) is not None:
                    return Arrived(sample)
            return Arrived(self._urgent.get())
        except queue.Empty:
            return None


class Voice:
    """Says something on a key."""

    def __init__(self, publisher: zenoh.Publisher) -> None:
        self.publisher = publisher

    def say(self, data: bytes) -> None:
        """Say it to whoever hears the key."""
        self.publisher.put(data)

    def put(self, data: bytes, note: bytes) -> None:
        """Say it, with a note beside it."""
        self.publisher.put(data, attachment=note)

    @property
    def is_heard(self) -> bool:
        """Whether somebody hears the key now."""
        matching: Any = self.publisher.matching_status
        return bool(matching.matching)

    def await_heard(self) -> None:
        """Wait until somebody hears: what is said from then on is not lost at the start."""
        changes = self.publisher.declare_matching_listener(zenoh.handlers.FifoChannel(_WAITING_CHANGES))
        matching: Any = self.publisher.matching_status
        while not matching.matching:
            matching = changes.recv()
        changes.undeclare()  # type: ignore[no-untyped-call]


class Question:
    """A question that somebody waits for an answer to; a block gives it back."""

    def __init__(self, key: str, query: zenoh.Query) -> None:
        self._key, self._query = key, query

    def __enter__(self) -> Question:
        self._query.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._query.__exit__(kind, error, trace)  # type: ignore[no-untyped-call]

    @property
    def data(self) -> bytes:
        """What was asked."""
        return self._query.payload.to_bytes() if self._query.payload else b""

    def answer(self, data: bytes) -> None:
        """Answer it."""
        self._query.reply(self._key, data)

    def refuse(self, why: str) -> None:
        """Say why there is no answer."""
        self._query.reply_err(why.encode())


class Questions:
    """What is asked on a key."""

    def __init__(self, key: str, queryable: Any) -> None:
        self._key, self._queryable = key, queryable

    def waiting(self) -> Question | None:
        """The next one that waits, if one does."""
        query = self._queryable.try_recv()
        return None if query is None else Question(self._key, query)


class Doorway:
    """Who enters at the hub."""

    def __init__(self, session: zenoh.Session, names: Iterable[str]) -> None:
        self._known = {identity(name): name for name in names}
        self._session = session
        self._events = session.info.declare_transport_events_listener(zenoh.handlers.RingChannel(_WAITING_ENTRANTS))

    def refuse_strangers(self) -> None:
        """Go on if each session that was opened is that of a process of the run.

        Raises
        ------
        StrangerEntered
            When one is not: as whom it entered, where that is known.
        """
        while (event := self._events.try_recv()) is not None:
            if event.kind != zenoh.SampleKind.PUT:
                continue
            called = str(event.transport.zid)
            proven, expected = self._proven(called), self._expected(called)
            if expected is None or proven not in (None, expected):
                raise StrangerEntered(
                    f"{proven or 'somebody who has a password of this run'} opened a session called {called}: a process "
                    "has one, called by the id of its login (docs/protocol.md)"
                )

    def _expected(self, called: str) -> str | None:
        return CONTROL if called.startswith(identity(CONTROL)) else self._known.get(called)

    def _proven(self, called: str) -> str | None:
        """Of whom the certificate is by which a session entered; None where it did by a password."""
        links = [link for link in self._session.info.links() if str(link.zid) == called]
        return next((link.auth_identifier for link in links if link.auth_identifier), None)


class Session:
    """One process on the network; a block leaves it.

    Parameters
    ----------
    config
        Where to connect or listen, and as whom: `session.client` or `rights.hub`.

    Raises
    ------
    NotCarried
        When it cannot connect, or listen.
    """

    def __init__(self, config: Mapping[str, Any]) -> None:
        zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]  # RUST_LOG, for who looks into what Zenoh does
        try:
            self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        except zenoh.ZError as error:
            raise NotCarried(reasons.plain(str(error))) from error
        self._leaving = threading.Lock()  # Zenoh fails in a thread that asks while another closes the session
        self._is_left = False
        self._tokens: list[zenoh.LivelinessToken] = []
        self._handing: list[Any] = []  # hand over for as long as somebody has them

    def __enter__(self) -> Session:
        self._session.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._leaving:
            self._is_left = True
            self._session.__exit__(kind, error, trace)  # type: ignore[no-untyped-call]

    def hears(self, key: str, room: int) -> Ear:
        """Hear a key; so many messages may wait."""
        return Ear(self._session.declare_subscriber(key, zenoh.handlers.FifoChannel(room)))

    def hears_both(self, urgent: str, key: str) -> Ears:
        """Hear two keys at once, of which one comes first."""
        ears = Ears()
        for of, take in ((urgent, ears.take_first), (key, ears.take)):
            self._session.declare_subscriber(of, zenoh.handlers.Callback(take, indirect=False))
        return ears

    def hands(self, key: str, take: Callable[[Arrived], None]) -> None:
        """Hand over what is said on a key, in a thread of the session's, where nothing may be said or asked."""
        self._handing.append(self._session.declare_subscriber(key, lambda sample: take(Arrived(sample))))

    def hears_anybody(self, key: str, in_a_tick: int) -> Ear:
        """Hear a key on which others may say as much as they like, and are to say so many messages in a tick.

        Of far more that wait, the oldest are lost: to wait for room would keep the whole session from hearing anything at all.
        """
        return Ear(self._session.declare_subscriber(key, zenoh.handlers.RingChannel(room_for(in_a_tick))))

    def says(self, key: str) -> Voice:
        """Say something on a key."""
        return self.says_once(key)

    def says_once(self, key: str) -> Voice:
        """Say something on a key that may be lost where links break."""
        return Voice(self._session.declare_publisher(key))

    def is_here(self, key: str) -> None:
        """Have it known by a key for as long as the session lasts."""
        self._tokens.append(self._session.liveliness().declare_token(key))  # one that is forgotten is taken back

    def sees(self, key: str, take: Callable[[str, bool], None]) -> None:
        """Hand over who comes, and who goes, by their keys, in a thread of the session's."""
        self._session.liveliness().declare_subscriber(
            key, lambda sample: take(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT), history=True
        )

    def answers(self, key: str, room: int) -> Questions:
        """Answer questions on a key; so many may wait."""
        return Questions(key, self._session.declare_queryable(key, zenoh.handlers.FifoChannel(room)))

    def asks(self, key: str, take: Callable[[Question], None]) -> None:
        """Hand over what is asked on a key, in a thread of the session's; whoever takes it answers in another."""
        self._session.declare_queryable(key, lambda query: take(Question(key, query)))

    def ask_all(self, key: str, data: bytes, patience_s: float) -> list[tuple[str, bytes]]:
        """What all those answer within so many seconds who answer on a key, each with the key it answers on.

        Raises
        ------
        NotCarried
            When the session is left.
        """
        everybody = {"target": zenoh.QueryTarget.ALL, "consolidation": zenoh.ConsolidationMode.NONE}
        answers = self._replies(key, data, patience_s, **everybody)
        return [(str(reply.ok.key_expr), reply.ok.payload.to_bytes()) for reply in answers if reply.ok is not None]

    def doorway(self, names: Iterable[str]) -> Doorway:
        """Watch who enters from now on, when these are expected."""
        return Doorway(self._session, names)

    def ask(self, key: str, data: bytes, patience_s: float) -> bytes:
        """Ask whoever answers on a key.

        Raises
        ------
        NotCarried
            When nobody answers for so many seconds, or whoever does refuses.
        """
        for reply in self._replies(key, data, patience_s):
            if reply.err is not None:
                raise NotCarried(f"refused: {reply.err.payload.to_string()}")
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
        raise NotCarried(f"no answer within {patience_s:g} s")

    def _replies(self, key: str, data: bytes, patience_s: float, **whom: Any) -> Any:
        with self._leaving:
            if self._is_left:
                raise NotCarried("the session is left")
            try:
                return self._session.get(key, payload=data, timeout=patience_s, **whom)
            except zenoh.ZError as error:
                raise NotCarried(reasons.plain(str(error))) from error


def joined(login: Login, patience_s: float | None = None) -> Session:
    """A session of a client of the hub, which is tried for as long as `patience_s`; None for ever.

    Raises
    ------
    NotCarried
        When it is not let in: why.
    NotTrusted
        When it has no proof of who it is that will do there.
    """
    try:
        return Session(client(login, patience_s))
    except NotCarried as error:
        raise NotCarried(login.why_refused() or str(error)) from error


def room_for(in_a_tick: int) -> int:
    """How many messages may wait of those who are to say so many in a tick, and may flood."""
    return max(_LEAST_ROOM, _TICKS * in_a_tick)


def await_heard(voices: Iterable[Voice]) -> None:
    """Wait until each of them has somebody to hear it."""
    for voice in voices:
        voice.await_heard()
