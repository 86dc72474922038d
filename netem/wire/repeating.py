"""Messages that are asked for again: what a link between machines lost is noticed by number, and had from who said it.

On one machine nothing is lost. Between machines a link breaks, and Zenoh, which comes back by itself, has lost what was said
meanwhile, without a word. So each message carries who says it and its number, a voice keeps the last ones, and an ear that
hears nothing for a while, or a number too high, asks for what is due (docs/decisions/0032).
"""

from __future__ import annotations

import queue
import secrets
import struct
import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import TracebackType
from typing import Any, Generic, NamedTuple, TypeVar

import msgspec

from netem.processes.wall_time import interrupting
from netem.wire.carrier import Arrived, Ear, NotCarried, Question, Session, Voice, room_for
from netem.wire.keys import again, once
from netem.wire.sequence import UninstructedLoss
from netem.wire.session import Login
from netem.wire.wrong import WireError, Wrong

T = TypeVar("T")
Lost = Callable[[str, int], None]  # on which key, and how many

_NOTE = struct.Struct("<8sQ")
_KEPT = 64  # of each voice: nobody in lockstep is more than two ticks behind
_NONE_IS_DUE = 1 << 62
_ASKED_AFTER_S = 0.5
_ANSWERED_WITHIN_S = 1.0


class Incoming(Generic[T]):
    """The messages of one speaker on one key, in the order they were said.

    Attributes
    ----------
    speaker, due
        Who speaks, and the number of the next message.
    """

    def __init__(self, speaker: bytes = b"", due: int = 0) -> None:
        self._begin(speaker, due)

    def _begin(self, speaker: bytes, due: int) -> None:
        self.speaker, self.due = speaker, due
        self._early: dict[int, T] = {}
        self._unseen: set[int] = set()  # had by asking; they may still come by themselves

    @property
    def is_broken(self) -> bool:
        """Whether one is missing before one that is here."""
        return bool(self._early)

    @property
    def unseen(self) -> int:
        """How many were had by asking, of which it is not known yet whether they come by themselves."""
        return len(self._unseen)

    def heard(self, speaker: bytes, number: int, message: T) -> tuple[list[T], int]:
        """Take in one that came by itself.

        Returns
        -------
        list, int
            Those whose turn it is now; and how many are known to be lost since, as what comes by itself comes in order.
        """
        if speaker != self.speaker:  # another process speaks here now
            self._begin(speaker, 0)
        lost = {one for one in self._unseen if one < number}
        self._unseen -= lost | {number}
        return self._taken(number, message), len(lost)

    def repeated(self, speaker: bytes, number: int, message: T) -> list[T]:
        """Take in one that was asked for: those whose turn it is now."""
        if speaker != self.speaker:
            self._begin(speaker, 0)
        if number >= self.due and number not in self._early:
            self._unseen.add(number)
        return self._taken(number, message)

    def _taken(self, number: int, message: T) -> list[T]:
        if number >= self.due:
            self._early[number] = message
        turn = []
        while self.due in self._early:
            turn.append(self._early.pop(self.due))
            self.due += 1
        return turn


class Asked(msgspec.Struct, frozen=True, array_like=True):
    """What an ear asks: by key who speaks there and which number is due; of those it does not know, from which number on."""

    first: int
    known: dict[str, tuple[bytes, int]]


class Repeated(msgspec.Struct, frozen=True, array_like=True):
    """What a voice answers: who speaks, the number of what it says next, and what it has said from the one asked for on."""

    speaker: bytes
    following: int
    said: list[tuple[int, bytes]]


class KeepingVoice(Voice):
    """Says something on a key, and once more to who asks.

    Parameters
    ----------
    voice
        That says it.
    key, speaker
        On which key, and who this process is.
    keeps
        How many of its last messages it can say again.
    """

    def __init__(self, voice: Voice, key: str, speaker: bytes, keeps: int) -> None:
        super().__init__(voice.publisher)
        self._key, self._speaker = key, speaker
        self._kept: deque[tuple[int, bytes]] = deque(maxlen=keeps)
        self._following = 0
        self._saying = threading.Lock()

    def say(self, data: bytes) -> None:
        """Say it to whoever hears the key, with its number for a note."""
        with self._saying:
            self._kept.append((self._following, data))
            self.put(data, _NOTE.pack(self._speaker, self._following))
            self._following += 1

    def repeat(self, question: bytes) -> bytes:
        """What is asked for.

        Raises
        ------
        WireError
            When it cannot be told what is.
        """
        asked = _read(Asked, question)
        speaker, due = asked.known.get(self._key, (self._speaker, asked.first))
        if speaker != self._speaker:
            due = 0
        with self._saying:
            said = [(number, data) for number, data in self._kept if number >= due]
            return msgspec.msgpack.encode(Repeated(self._speaker, self._following, said))


class AskingEar(Ear):
    """Hears what is said on a key, in order and whole, or fails.

    Parameters
    ----------
    session
        Whose it is.
    key, room
        Which may be one of many; and how many messages may wait.
    lost
        Told how many the transport lost.
    """

    def __init__(self, session: Session, key: str, room: int, lost: Lost) -> None:
        self._session, self._key, self._lost = session, key, lost
        self._arrivals: queue.Queue[Arrived | None] = queue.Queue(room)
        self._turn: deque[Arrived | Again] = deque()
        self._incoming: dict[str, Incoming[Arrived | Again]] = {}
        self._counting = threading.Lock()  # who leaves the session is another thread than who hears
        session.hands(key, self._arrivals.put)
        for key, answer in self._answers(_NONE_IS_DUE):  # who has spoken to a predecessor of this process goes on
            self._incoming[key] = Incoming(answer.speaker, answer.following)

    def next(self) -> Arrived | Again:  # type: ignore[override]
        """Wait for the next message.

        Raises
        ------
        UninstructedLoss
            When one is lost, and who said it has it no more.
        WireError
            When who is asked answers what is no answer.
        NotCarried
            When the session is left.
        """
        while not self._turn:
            try:
                arrived = self._arrivals.get(timeout=_ASKED_AFTER_S)
            except queue.Empty:
                self._ask()
                continue
            if arrived is None:
                raise NotCarried("the session is left")
            self._hear(arrived)
        return self._turn.popleft()

    def close(self) -> None:
        """Nothing is heard any more: what had to be asked for was lost."""
        with self._counting:
            for key, incoming in self._incoming.items():
                if incoming.unseen:
                    self._lost(key, incoming.unseen)
            self._incoming.clear()
        with suppress(queue.Full):  # then nobody waits
            self._arrivals.put_nowait(None)

    def _hear(self, arrived: Arrived) -> None:
        if len(arrived.note) != _NOTE.size:  # a program of somebody else's making does not number: docs/machines.md
            self._turn.append(arrived)
            return
        speaker, number = _NOTE.unpack(arrived.note)
        with self._counting:
            incoming = self._incoming.setdefault(arrived.key, Incoming())
            turn, lost = incoming.heard(speaker, number, arrived)
        self._turn += turn
        if lost:
            self._lost(arrived.key, lost)
        if incoming.is_broken:
            self._ask()

    def _ask(self) -> None:
        for key, answer in self._answers(0):
            with self._counting:
                incoming = self._incoming.setdefault(key, Incoming())
                _refuse_gaps(key, answer, incoming)
                for number, data in answer.said:
                    self._turn += incoming.repeated(answer.speaker, number, Again(key, data))

    def _answers(self, first: int) -> list[tuple[str, Repeated]]:
        """What those answer who may say such keys; on which they do, and no word of theirs, says who they are."""
        with self._counting:
            asked = Asked(first, {key: (one.speaker, one.due) for key, one in self._incoming.items()})
        answers = self._session.ask_all(again(self._key), msgspec.msgpack.encode(asked), _ANSWERED_WITHIN_S)
        return [(once(key), _read(Repeated, data, once(key))) for key, data in answers]


def _refuse_gaps(key: str, answer: Repeated, incoming: Incoming[Any]) -> None:
    due = incoming.due if answer.speaker == incoming.speaker else 0
    oldest = answer.said[0][0] if answer.said else answer.following
    if oldest > due:
        raise UninstructedLoss(
            f"{key}: the transport lost {oldest - due} messages from {due} on, and who said them has not kept them",
            Wrong.SKIPPED,
        )


def _read(kind: type[T], data: bytes, whose: str = "somebody") -> T:
    try:
        return msgspec.msgpack.decode(data, type=kind)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise WireError(f"{whose}: {kind.__name__}: {error} (see docs/protocol.md)") from error


class Again(NamedTuple):
    """What was asked for again; like `Arrived`."""

    key: str
    data: bytes

    @property
    def size(self) -> int:
        """How many bytes there are."""
        return len(self.data)


class RepeatingSession(Session):
    """A session between machines.

    Parameters
    ----------
    config
        Of the session.
    lost
        Told on which key how many messages were lost, and had again.
    keeps
        How many of its last messages a voice can say again.
    """

    def __init__(self, config: Mapping[str, Any], lost: Lost, keeps: int = _KEPT) -> None:
        super().__init__(config)
        self._lost, self._keeps = lost, keeps
        self._speaker = secrets.token_bytes(8)
        self._ears: list[AskingEar] = []
        self._asked: queue.SimpleQueue[tuple[KeepingVoice, Question] | None] = queue.SimpleQueue()
        self._answering = threading.Thread(target=self._answer, daemon=True)
        self._answering.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for ear in self._ears:
            ear.close()
        self._asked.put(None)
        self._answering.join()
        super().__exit__(kind, error, trace)

    def hears(self, key: str, room: int) -> Ear:
        """Hear a key, in order and whole."""
        ear = AskingEar(self, key, room, self._lost)
        self._ears.append(ear)
        return ear

    def hears_anybody(self, key: str, in_a_tick: int) -> Ear:
        """Hear a key on which others may say as much as they like, in order and whole."""
        return self.hears(key, room_for(in_a_tick))

    def says(self, key: str) -> Voice:
        """Say something on a key, and once more to who asks."""
        voice = KeepingVoice(self.says_once(key), key, self._speaker, self._keeps)
        self.asks(again(key), lambda question: self._asked.put((voice, question)))
        return voice

    def _answer(self) -> None:
        while asked := self._asked.get():
            voice, question = asked
            with question:
                try:
                    question.answer(voice.repeat(question.data))
                except WireError as error:
                    question.refuse(str(error))


def opened(config: Mapping[str, Any], login: Login, lost: Lost, *, in_real_time: bool = False) -> Session:
    """The session of a process: within one machine, and in real time, where nobody waits, nothing is asked for again."""
    if in_real_time:
        interrupting()
    return Session(config) if login.is_local or in_real_time else RepeatingSession(config, lost)
