"""What a process of a run prints is data: what is not its own to say fails the run and names it."""

import json
import sys
import time

import pytest

from affinet.runtimes import told
from affinet.runtimes.child import RunFailed
from affinet.runtimes.interruption import Interruption
from affinet.runtimes.supervision import ProcessGroup
from affinet.runtimes.told import NotItsOwn

BEAT = {"event": "beat", "k": 3, "what": "its inbox", "waits": ["netem"]}
FACTS = {"agents": [1], "remembering": [], "k": 3}


def line(said):
    return json.dumps(said).encode()


@pytest.mark.parametrize(
    ("role", "said"),
    [
        *((role, {"event": "ready"}) for role in ("agent", "centre", "netem", "world")),
        *((role, BEAT) for role in ("agent", "centre", "netem", "world")),
        *((role, {"event": "failed", "reason": "why"}) for role in ("agent", "centre", "netem", "world")),
        *(
            (role, {"event": "lost", "key": "affinet/run/agent/3/rx", "count": 2})
            for role in ("agent", "host", "netem")
        ),
        *((role, {"event": "refused", "of": [[2, "flood", 7]]}) for role in ("centre", "netem", "world")),
        ("netem", {"event": "refused", "of": [[None, "malformed", 1]]}),
        ("agent", {"event": "done"}),
        ("centre", {"event": "done"}),
        ("netem", {"event": "done"}),
        ("world", {"event": "done", "uninstructed": 2}),
        ("world", {"event": "tick", "k": 50, "error": 0.5}),
        ("world", {"event": "tick", "k": 50, "error": float("nan")}),
        ("world", {"event": "fired", "triggers": [0], "k": 3}),
        *(("world", {"event": event, **FACTS}) for event in ("kill", "restart", "pause", "resume")),
    ],
)
def test_what_is_ones_own_is_read_as_it_was_said(role, said):
    assert repr(told.read(role, line(said))) == repr(said)


# All of these ended the launcher by a traceback, or were obeyed.
@pytest.mark.parametrize(
    "said",
    [
        pytest.param(b"tick 10", id="print('tick', 10)"),
        pytest.param(b"", id="an empty line"),
        pytest.param(b"3", id="a number"),
        pytest.param(b"[1, 2]", id="a list"),
        pytest.param(b'"ready"', id="a text"),
        pytest.param(b"null", id="null"),
        pytest.param(b"\xff\xfe\x00", id="no UTF-8"),
        pytest.param(b'{"event": "ready"', id="half a map"),
        pytest.param(b"{}", id="no event"),
        pytest.param(b'{"event": 5}', id="an event that is no text"),
        pytest.param(b'{"event": ["ready"]}', id="an event that is a list"),
        pytest.param(b'{"event": "take-off"}', id="an unknown event"),
        pytest.param(b"[" * 100_000, id="nested too deep"),
        pytest.param(b"1" * 10_000, id="a number of ten thousand digits"),
        *(
            pytest.param(line({"event": event, **FACTS}), id=f"the world's {event}")
            for event in ("kill", "restart", "pause", "resume")
        ),
        pytest.param(line({"event": "tick", "k": 50, "error": 0.5}), id="the world's tick"),
        pytest.param(line({"event": "fired", "triggers": [0], "k": 3}), id="the world's fired"),
    ],
)
def test_what_is_not_ones_own_is_refused_with_what_may_be_said(said):
    with pytest.raises(NotItsOwn) as error:
        told.read("agent", said)
    shown = repr(said)[1:] if len(said) < 100 else f"({len(said):,} bytes)"
    assert shown in str(error.value)
    assert str(error.value).endswith(
        "on its standard output, where it may say ready, beat, failed, lost, user-code, done, as JSON"
    )
    assert len(str(error.value)) < 300


@pytest.mark.parametrize(
    ("role", "said", "needs"),
    [
        ("agent", {"event": "failed"}, "'failed' needs reason"),
        ("agent", {"event": "failed", "reason": 5}, "'failed' needs reason"),
        ("agent", {"event": "failed", "reason": None}, "'failed' needs reason"),
        ("agent", {"event": "ready", "k": 3}, "'ready' has nothing else in it"),
        ("agent", {"event": "done", "in_flight": 3}, "'done' has nothing else in it"),
        ("agent", BEAT | {"k": -1}, "'beat' needs k, what, waits"),
        ("agent", BEAT | {"k": 1.0}, "'beat' needs k, what, waits"),
        ("agent", BEAT | {"k": True}, "'beat' needs k, what, waits"),
        ("agent", BEAT | {"k": 1 << 64}, "'beat' needs k, what, waits"),
        ("agent", BEAT | {"waits": "netem"}, "'beat' needs k, what, waits"),
        ("agent", BEAT | {"waits": [1]}, "'beat' needs k, what, waits"),
        ("agent", {"event": "lost", "key": "a key 1\nleave", "count": 2}, "'lost' needs key, count"),
        ("netem", {"event": "done", "in_flight": 0}, "'done' has nothing else in it"),
        ("world", {"event": "done", "in_flight": 0}, "'done' needs uninstructed"),
        ("world", {"event": "tick", "k": 3, "error": "0.5"}, "'tick' needs k, error"),
        ("world", {"event": "kill", "agents": 1, "remembering": [], "k": 3}, "'kill' needs agents, remembering, k"),
        ("world", {"event": "kill", "agents": ["1"], "remembering": [], "k": 3}, "'kill' needs agents, remembering, k"),
    ],
)
def test_an_event_with_other_facts_than_its_own_is_refused_by_name(role, said, needs):
    with pytest.raises(NotItsOwn) as error:
        told.read(role, line(said))
    assert str(error.value).endswith(f"on its standard output: {needs}")


def test_text_of_children_is_shown_as_any_terminal_takes_it():
    assert told.printable("a\x1b[2J\ud800\x07é\n\tb") == "a\\x1b[2J\\ud800\\x07é\n\tb"


# ---- through a pipe


def crew(tmp_path):
    return ProcessGroup(tmp_path, 3.0, Interruption())


def program(says):
    return [sys.executable, "-S", "-c", f"import os, time\n{says}\ntime.sleep(600)"]


def failure_of(tmp_path, says):
    with crew(tmp_path) as flying:
        child = flying.start("agent", program(says), {}, 5)
        with pytest.raises(RunFailed) as failure:
            listen_until(flying, lambda: False)
        return str(failure.value).removeprefix(f"agent 5 (pid {child.process.pid})")


def listen_until(flying, condition):
    heard, deadline = [], time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        heard += flying.listen()
    return heard


@pytest.mark.parametrize(
    ("says", "reason"),
    [
        ("print('tick', 10, flush=True)", ": it said 'tick 10' on its standard output, where it may say"),
        ("os.write(1, b'\\xff\\n')", r": it said '\xff' on its standard output, where it may say"),
        (
            """os.write(1, b'{"event":"kill","agents":[1]}\\n')""",
            """: it said '{"event":"kill","agents":[1]}' on its standard output, where it may say""",
        ),
        (
            """os.write(1, b'{"event":"failed"}\\n')""",
            """: it said '{"event":"failed"}' on its standard output: 'failed' needs reason""",
        ),
        ("while True: os.write(1, b'x' * 65536)", ", and does not end the line"),
        ("""os.write(1, b'{"event":"ready"}\\n' * 2)""", ": it said twice that it is ready (docs/protocol.md)"),
        ("""os.write(1, b'{"event":"done"}\\n')""", ": it said that it is done, and was not flying (docs/protocol.md)"),
    ],
)
def test_a_child_that_says_what_is_not_its_own_fails_the_run_and_is_named(says, reason, tmp_path):
    assert reason in failure_of(tmp_path, says)


def test_a_reason_goes_to_the_summary_without_what_a_terminal_would_obey(tmp_path):
    says = """os.write(1, b'{"event": "failed", "reason": "\\\\u001b[2J\\\\ud800 no"}\\n')"""
    assert failure_of(tmp_path, says) == r"agent 5: \x1b[2J\ud800 no"


def test_lines_that_come_in_pieces_are_whole_in_the_end(tmp_path):
    says = """for byte in b'{"event":"ready"}\\n{"event":"done"}\\n': os.write(1, bytes([byte])); time.sleep(0.002)"""
    with crew(tmp_path) as flying:
        child = flying.start("agent", program(says), {}, 5)
        heard = listen_until(flying, lambda: child.is_done)
    assert [event["event"] for _, event in heard] == ["ready", "done"]


def test_what_one_incarnation_holds_is_freed_with_it(tmp_path):
    import psutil

    with crew(tmp_path) as flying:
        descriptors = []
        for _ in range(200):
            flying.kill(flying.start("agent", ["sleep", "600"], {}, 5))
            descriptors.append(psutil.Process().num_fds())
    assert descriptors[-1] == descriptors[0]  # there were 200 pipes more


def test_a_death_by_itself_frees_its_pipes_too(tmp_path):
    import psutil

    with crew(tmp_path) as flying:
        before = psutil.Process().num_fds()
        for _ in range(20):
            child = flying.start("agent", ["true"], {}, 5)
            child.expected_to_die = True
            listen_until(flying, lambda child=child: child.is_mute)
        assert psutil.Process().num_fds() == before


def test_who_left_with_an_error_after_the_run_fails_it(tmp_path):
    for code, how in ((1, "ended with exit status 1"), ("os.kill(os.getpid(), 11)", "killed by SIGSEGV")):
        leaves = f"os._exit({code})" if code == 1 else code
        says = """os.write(1, b'{"event":"ready"}\\n{"event":"done"}\\n')\n""" + leaves
        with crew(tmp_path) as flying:
            child = flying.start("agent", program(says), {}, 5)
            listen_until(flying, lambda child=child: child.is_done)
            flying.release()
            with pytest.raises(RunFailed, match=rf"^agent 5 \(pid \d+\) was {how}\. It had said nothing\.$"):
                flying.await_all_gone()


def test_who_was_killed_by_the_script_has_not_left_with_an_error(tmp_path):
    with crew(tmp_path) as flying:
        flying.kill(flying.start("agent", ["sleep", "600"], {}, 5))
        flying.release()
        flying.await_all_gone()


def test_a_death_is_noticed_though_a_grandchild_keeps_the_pipe_open(tmp_path):
    says = "import subprocess; subprocess.Popen(['sleep', '5']); os._exit(3)"
    with crew(tmp_path) as flying:
        child = flying.start("agent", program(says), {}, 5)
        with pytest.raises(RunFailed, match=r"^agent 5 \(pid \d+\) was ended with exit status 3"):
            flying.await_ready([child])


def test_the_end_of_a_long_log_is_told(tmp_path):
    says = "os.write(2, b'y' * 3_000_000 + b'\\nthe end\\n'); os._exit(3)"
    assert failure_of(tmp_path, says).endswith("\n    the end")


@pytest.mark.parametrize(
    "of",
    [
        *(7, None, {}, [7], [[]], [[2, "flood"]], [[2, "flood", 7, 8]]),
        *(
            [["2", "flood", 7]],
            [[-1, "flood", 7]],
            [[2, "lunch", 7]],
            [[2, ["flood"], 7]],
            [[2, "flood", -1]],
            [[2, "flood", 0.5]],
        ),
    ],
    ids=str,
)
def test_what_is_refused_is_told_as_agents_kinds_and_counts(of):
    with pytest.raises(NotItsOwn, match="'refused' needs of"):
        told.read("world", line({"event": "refused", "of": of}))


def test_an_agent_tells_of_nothing_that_it_refused():
    with pytest.raises(NotItsOwn, match="where it may say"):
        told.read("agent", line({"event": "refused", "of": []}))


def test_what_is_refused_is_counted_and_moves_nothing(tmp_path):
    """Before it was counted apart, a flood would have been progress, and a run that waits would never have stalled."""
    says = [{"event": "refused", "of": [[2, "flood", count]]} for count in (7, 9)]
    program = [sys.executable, "-S", "-c", "import sys; print(sys.argv[1], flush=True); sys.stdin.read()"]
    with ProcessGroup(tmp_path, 60.0, Interruption()) as crew:
        child = crew.start("world", [*program, "\n".join(map(json.dumps, says))], {})
        while child.refused != {(2, "flood"): 9}:
            assert crew.listen() == []
        assert crew._moved_s == 0.0
