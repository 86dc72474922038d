"""What a link between machines lost is noticed and had again, in order; nothing is lost twice, or counted that came."""

import queue
import threading
from datetime import timedelta

import msgspec
import pytest

from netem.wire import authority
from netem.wire.arrays import WireError
from netem.wire.carrier import NotCarried, await_heard
from netem.wire.keys import Keys, again
from netem.wire.repeating import Asked, Incoming, Repeated, RepeatingSession, opened
from netem.wire.rights import hub
from netem.wire.sequence import UninstructedLoss
from netem.wire.session import HUB, WORLD, Login, agent_name, client

ONE, OTHER = b"one", b"other"


def test_what_comes_in_order_is_passed_on_at_once():
    incoming = Incoming()
    assert [incoming.heard(ONE, number, number) for number in range(3)] == [([0], 0), ([1], 0), ([2], 0)]
    assert not incoming.is_broken


def test_what_comes_too_early_waits_for_what_was_asked_for_and_that_was_lost():
    incoming = Incoming()
    assert incoming.heard(ONE, 1, "b") == ([], 0)
    assert incoming.is_broken
    assert incoming.repeated(ONE, 0, "a") == ["a", "b"]
    assert incoming.heard(ONE, 2, "c") == (["c"], 1)
    assert not incoming.is_broken


def test_what_was_asked_for_and_then_comes_by_itself_was_late_and_not_lost():
    incoming = Incoming()
    assert incoming.repeated(ONE, 0, "a") == ["a"]
    assert incoming.unseen == 1
    assert incoming.heard(ONE, 0, "a") == ([], 0)
    assert incoming.heard(ONE, 1, "b") == (["b"], 0)
    assert incoming.unseen == 0


def test_nothing_is_passed_on_twice():
    incoming = Incoming()
    incoming.heard(ONE, 0, "a")
    assert incoming.heard(ONE, 0, "a") == ([], 0)
    assert incoming.repeated(ONE, 0, "a") == []
    assert incoming.unseen == 0


def test_another_process_that_speaks_begins_anew():
    incoming = Incoming(ONE, 7)
    assert incoming.heard(OTHER, 0, "a") == (["a"], 0)
    assert (incoming.speaker, incoming.due) == (OTHER, 1)


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    folder = tmp_path_factory.mktemp("certificates") / "keys"
    authority.make(folder, [HUB, WORLD, agent_name(1), agent_name(2)], [], timedelta(days=1))
    return str(folder)


@pytest.fixture
def star(keys, free_endpoint):
    """A hub between machines, and clients of it."""
    run, login = Keys("run"), Login(free_endpoint, HUB, keys=keys)
    lost = []

    def joined(name):
        of = Login(free_endpoint, name, keys=keys)
        return opened(client(of, 60.0), of, lambda key, count: lost.append((key, count)))

    with RepeatingSession(hub(login, None, run, [1, 2], {}), lambda *one: lost.append(one)) as medium:
        yield run, medium, joined, lost


def skip(voice):
    """The transport loses what is said next."""

    def put(_data, _note):
        del voice.put

    voice.put = put


def test_a_message_that_is_lost_before_others_is_had_again_and_counted(star):
    run, medium, joined, lost = star
    ear = medium.hears(run.broadcast("*", "*"), 16)
    with joined("agent-1") as agent:
        voice = agent.says(run.broadcast(1, "theta"))
        await_heard([voice])
        voice.say(b"a")
        skip(voice)
        voice.say(b"b")
        voice.say(b"c")
        assert [ear.next().data for _ in range(3)] == [b"a", b"b", b"c"]
        voice.say(b"d")
        assert ear.next().data == b"d"
    assert lost == [(run.broadcast(1, "theta"), 1)]


def test_the_last_message_too_though_nothing_comes_after_it(star):
    run, medium, joined, lost = star
    ear = medium.hears(run.broadcast("*", "*"), 16)
    with joined("agent-1") as one, joined("agent-2") as two:
        voices = [agent.says(run.broadcast(number, "theta")) for number, agent in ((1, one), (2, two))]
        await_heard(voices)
        skip(voices[1])
        for voice in voices:
            voice.say(b"a")
        heard = {ear.next().key for _ in range(2)}
    assert heard == {run.broadcast(1, "theta"), run.broadcast(2, "theta")}
    ear.close()
    assert lost == [(run.broadcast(2, "theta"), 1)]


def test_from_client_to_client_past_the_medium(star):
    run, _, joined, lost = star
    with joined(WORLD) as world, joined("agent-1") as agent:
        ear, voice = world.hears(run.act("*"), 16), agent.says(run.act(1))
        await_heard([voice])
        skip(voice)
        voice.say(b"a")
        assert ear.next().data == b"a"
    assert lost == [(run.act(1), 1)]


def test_a_process_that_is_new_is_not_told_what_its_predecessor_was(star):
    run, medium, joined, _ = star
    voice = medium.says(run.inbox(1))
    with joined("agent-1") as first:
        ear = first.hears(run.inbox(1), 16)
        await_heard([voice])
        voice.say(b"to the first")
        assert ear.next().data == b"to the first"
    with joined("agent-1") as second:
        ear = second.hears(run.inbox(1), 16)
        await_heard([voice])
        voice.say(b"to the second")
        assert ear.next().data == b"to the second"


def test_what_nobody_has_any_more_ends_the_run_by_its_key(star):
    run, medium, joined, _ = star
    ear = medium.hears(run.act("*"), 16)
    with joined("agent-1") as agent:
        voice = agent.says(run.act(1))
        await_heard([voice])
        voice.say(b"heard")
        ear.next()
        for _ in range(65):
            skip(voice)
            voice.say(b"lost")
        with pytest.raises(UninstructedLoss, match="agent/1/act: the transport lost 1 messages from 1 on"):
            ear.next()


def test_an_agent_cannot_ask_for_what_was_said_to_another(star):
    run, medium, joined, _ = star
    voice = medium.says(run.inbox(2))
    with joined("agent-2") as two, joined("agent-1") as one:
        ear = two.hears(run.inbox(2), 16)
        await_heard([voice])
        voice.say(b"private")
        assert ear.next().data == b"private"
        question = msgspec.msgpack.encode(Asked(0, {}))
        assert two.ask_all(again(run.inbox(2)), question, 5.0)
        assert not one.ask_all(again(run.inbox(2)), question, 1.0)


def test_rubbish_for_a_question_is_refused_and_the_next_one_answered(star):
    run, medium, joined, _ = star
    medium.says(run.inbox(1)).say(b"private")
    with joined("agent-1") as one:
        for rubbish in (b"", b"\xc1", msgspec.msgpack.encode("hello"), b"\x91" * 5000):
            assert not one.ask_all(again(run.inbox(1)), rubbish, 5.0)
        assert one.ask_all(again(run.inbox(1)), msgspec.msgpack.encode(Asked(0, {})), 5.0)


def answering(agent, key, data):
    """An agent that answers whatever it likes to who asks for what it said on a key."""
    asked = queue.SimpleQueue()
    agent.asks(again(key), asked.put)

    def answer():
        with asked.get() as question:
            question.answer(data)

    threading.Thread(target=answer, daemon=True).start()


def test_rubbish_for_an_answer_ends_the_run_by_the_name_of_who_gave_it(star):
    run, medium, joined, _ = star
    ear = medium.hears(run.act("*"), 16)
    with joined("agent-1") as agent:
        answering(agent, run.act(1), b"rubbish")
        with pytest.raises(WireError, match=f"{run.act(1)}: Repeated: "):
            ear.next()


def test_who_answers_speaks_on_its_own_key_alone(star):
    run, medium, joined, _ = star
    ear = medium.hears(run.act("*"), 16)
    said = msgspec.msgpack.encode(Repeated(b"somebody", 1, [(0, b"as agent 2")]))
    with joined("agent-1") as agent:
        answering(agent, run.act(1), said)
        assert ear.next().key == run.act(1)


def test_who_still_asks_while_another_thread_leaves_the_session_is_told_that_it_is_left(star):
    """Zenoh fails in either thread if one closes a session in which the other asks, which a busy machine makes likely."""
    run, medium, joined, _ = star
    medium.says(run.inbox(1)).say(b"private")
    question = msgspec.msgpack.encode(Asked(0, {}))
    ended = []
    failed = threading.Event()

    def ask(session, begun):
        try:
            while not failed.is_set():
                session.ask_all(again(run.inbox(1)), question, 5.0)
                begun.set()
        except RuntimeError as error:
            ended.append(error)

    try:
        for _ in range(20):
            with joined("agent-1") as one:
                begun = threading.Event()
                thread = threading.Thread(target=ask, args=(one, begun))
                thread.start()
                assert begun.wait(60.0)
            thread.join()
    finally:
        failed.set()
    assert [(type(error), str(error)) for error in ended] == 20 * [(NotCarried, "the session is left")]
