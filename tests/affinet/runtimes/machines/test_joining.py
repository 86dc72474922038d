"""Who may join a run over several machines: the same affinet, the same bits, the same scenario, and each on its own seat."""

from dataclasses import fields, replace

import msgspec
import pytest
from fleets import keys_in

from affinet.runtimes.child import RunFailed
from affinet.runtimes.machines import identity, joining
from affinet.runtimes.machines.coordinator import Coordinator
from affinet.runtimes.machines.joining import Joining
from affinet.runtimes.machines.machine import Machine, Wanted
from affinet.runtimes.machines.place import Place, Refused, of_folder
from affinet.runtimes.machines.remote import RemoteProcess
from netem.wire import seats
from netem.wire.keys import again
from netem.wire.offset import ClockOffset
from netem.wire.repeating import Asked, RepeatingSession
from netem.wire.session import COORDINATOR, HUB, Login, client

OWN = identity.own()
ASKS = {
    "machine": "b",
    "folder": "/there",
    "keys": "/keys",
    "identity": OWN,
    "scenario": None,
    "listens": None,
    "clock": ClockOffset(0.0, 0.0),
}


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    return str(keys_in(tmp_path_factory.mktemp("certificates") / "keys", 2))


@pytest.fixture
def coordinator(keys, free_endpoint):
    names = {HUB: None, "agent-1": None, "agent-2": "the second"}
    login = Login(free_endpoint, COORDINATOR, keys=keys)
    with Coordinator(login, names, scenario="this one", gone_after_s=20.0) as coordinator:
        yield coordinator


@pytest.fixture
def place(coordinator, keys):
    """A machine's end of a seat."""
    endpoint = coordinator._login.endpoint
    return lambda seat: Place(Login(endpoint, seat, keys=keys), lambda *_: None)


def looked_at_for_ever(coordinator):
    while True:
        coordinator.heed()


def asks(seat, **other):
    return Joining(seat=seat, **(ASKS | other))


def refused(place, seat, **other):
    with place(seat) as at, pytest.raises(Refused) as error:
        at.join(asks(seat, **other))
    return str(error.value)


def test_who_is_the_same_gets_its_seat_and_is_awaited_no_more(coordinator, place):
    with place("agent-1") as at:
        assert at.join(asks("agent-1", scenario="this one")).gone_after_s == 20.0
        assert coordinator.awaited == [HUB, "agent-2"]
        assert coordinator.seats["agent-1"].where == "agent 1 on b"
    with place("agent-2") as at:
        at.join(asks("agent-2"))
        assert coordinator.seats["agent-2"].where == "agent 2 on the second"


OTHERS = {
    "protocol": 0,
    "affinet": "0.0.1",
    "python": "3.9",
    "numpy": "1.0",
    "zenoh": "0.1",
    "code": "x",
    "arithmetic": "y",
}


@pytest.mark.parametrize(("name", "other"), OTHERS.items(), ids=OTHERS)
def test_who_flies_with_anything_else_is_refused_in_a_line_that_names_it(place, name, other):
    said = refused(place, "agent-1", identity=replace(OWN, **{name: other}))
    assert said.startswith(f"agent 1: agent-1 on b is not the same as the coordinator: {name} is {other} there, and ")
    assert "\n" not in said


def test_all_that_makes_a_machine_what_it_is_was_tried():
    assert {field.name for field in fields(OWN)} == OTHERS.keys()


def test_another_scenario_is_refused(place):
    assert "agent-1 on b has another scenario" in refused(place, "agent-1", scenario="another")


def test_a_medium_that_listens_nowhere_is_refused(place):
    assert "the medium has to listen: give --listen" in refused(place, HUB)


def test_a_seat_is_given_once(place):
    with place("agent-1") as at:
        at.join(asks("agent-1"))
        with pytest.raises(Refused, match="agent 1 on b has joined already"):
            at.join(asks("agent-1", machine="c"))


def test_what_no_affinet_says_is_refused(place, coordinator):
    with place("agent-1") as at, pytest.raises(Refused, match="another affinet speaks there"):
        at._ask(seats.join("agent-1"), b"hello")
    assert "agent-1" in coordinator.awaited


def test_a_seat_hears_what_is_for_it_and_nothing_that_is_for_another(coordinator, place, keys, free_endpoint):
    with place("agent-1") as at:
        at.join(asks("agent-1"))
    question = msgspec.msgpack.encode(Asked(0, {}))
    coordinator.seats["agent-1"].say(joining.Start(1, "agent 1"))
    for seat, hears in (("agent-1", True), ("agent-2", False)):
        with RepeatingSession(client(Login(free_endpoint, seat, keys=keys), 60.0), lambda *_: None) as session:
            assert bool(session.ask_all(again(seats.down("agent-1")), question, 2.0)) is hears


def test_a_seat_cannot_join_as_another(place):
    with place("agent-2") as at, pytest.raises(Refused):
        at._ask(seats.join("agent-1"), joining.pack(asks("agent-1")))


def test_a_machine_that_says_what_nobody_should_ends_the_run_by_its_name(coordinator, place):
    with place("agent-1") as at:
        at.join(asks("agent-1"))
        at._up.say(b"rubbish")
        with pytest.raises(RunFailed, match="agent 1 on b: between machines: "):
            looked_at_for_ever(coordinator)


def test_a_machine_whose_session_was_closed_is_missed_at_once(coordinator, place):
    with place("agent-1") as at:
        at.join(asks("agent-1"))
        at.beat()
        while not coordinator.seats["agent-1"].is_here:
            coordinator.heed()
    with pytest.raises(RunFailed, match="agent 1 on b: the command there has ended, and its processes with it"):
        looked_at_for_ever(coordinator)


def test_the_clock_is_measured_against_that_of_the_coordinator(place):
    with place("agent-1") as at:
        clock = at.clock()
    assert 0.0 < clock.uncertainty_s < 5.0
    assert abs(clock.offset_s) <= clock.uncertainty_s


def test_what_a_process_on_another_machine_says_comes_out_of_a_pipe(tmp_path):
    said = []
    with (tmp_path / "log").open("ab") as log:
        process = RemoteProcess(3, "b", said.append, lambda: False, log)
    process.take(joining.Started(3, 77))
    process.take(joining.Told(3, b"event\n"))
    process.take(joining.Logged(3, b"line\n"))
    process.stdin.write(b"order\n")
    process.terminate()
    assert process.poll() is None
    process.take(joining.Ended(3, 5))
    assert (process.pid, process.wait(), process.stdout.read()) == (77, 5, b"event\n")
    assert said == [joining.Say(3, b"order\n"), joining.Signal(3, 15)]
    for late in (joining.Told(3, b"more"), joining.Logged(3, b"more"), joining.Ended(3, 6), joining.Failed("too late")):
        process.take(late)  # its pipes are closed, and their numbers may be those of other files by now
    assert process.poll() == 5
    assert (tmp_path / "log").read_bytes() == b"line\n"
    process.stdout.close()


def test_an_address_that_is_taken_is_said(coordinator, keys):
    login = Login(coordinator._login.endpoint, COORDINATOR, keys=keys)
    second = Coordinator(login, {HUB: None}, scenario="this one", gone_after_s=20.0)
    with pytest.raises(RunFailed, match=f"the coordinator cannot listen at {login.endpoint}: .*in use"):
        second.__enter__()


def test_a_folder_gives_the_files_that_are_asked_for_and_none_beside_it(tmp_path):
    (tmp_path / "there").mkdir()
    for name in ("journal.arrows", "journal-2.arrows", "held"):
        (tmp_path / "there" / name).write_bytes(name.encode())
    (tmp_path / "secret").write_text("of another")
    listed = joining.unpack(dict[str, int], of_folder(tmp_path / "there", joining.Listing(ending=".arrows")))
    assert listed == {"journal-2.arrows": 16, "journal.arrows": 14}
    assert of_folder(tmp_path / "there", joining.Part(name="journal.arrows", start=8)) == b"arrows"
    with pytest.raises(FileNotFoundError):
        of_folder(tmp_path / "there", joining.Part(name="../secret", start=0))


def test_a_command_that_is_refused_one_seat_leaves_the_others_to_who_types_it_right(
    coordinator, place, keys, tmp_path, monkeypatch
):
    """Before it kept them, and the run was given up as if a link were cut."""
    monkeypatch.setattr("affinet.runtimes.machines.machine.signal.signal", lambda *_: None)  # this process goes on
    wanted = Wanted(("agent-1", HUB), coordinator._login.endpoint, keys)
    with pytest.raises(Refused, match="the medium has to listen"), Machine(tmp_path) as mistyped:
        mistyped.join(wanted)
    assert "agent-1" in coordinator.awaited
    coordinator.heed()
    with place("agent-1") as right:
        right.join(asks("agent-1"))
        assert "agent-1" not in coordinator.awaited


def test_a_seat_whose_process_runs_is_not_given_back(coordinator, place, tmp_path):
    with place("agent-1") as at, (tmp_path / "log").open("wb") as log:
        at.join(asks("agent-1"))
        process = coordinator.start("agent-1", "agent 1", log)
        at.give_back()
        assert "agent-1" not in coordinator.awaited
        process.stdin.close()
        process.stdout.close()
