"""Runs over several machines: the bits of one, whatever becomes of a link, and nothing that is left anywhere."""

import json
import signal
import socket
from importlib.resources import files

import numpy as np
import pytest
from awaiting import await_true
from fleets import AFFINET, Fleet, ended, keys_in
from flying import PROCESSES, digest_of
from networks import network

from affinet.verdicts import reading
from netem.medium import journal
from world.books import history, timing

pytestmark = PROCESSES

PORT = 7447


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    addresses = [f"10.77.0.{number}" for number in (1, 2, 3)]
    return keys_in(tmp_path_factory.mktemp("certificates") / "keys", 7, *addresses)


@pytest.fixture
def fleet(tmp_path):
    with Fleet(tmp_path) as fleet:
        yield fleet


@pytest.fixture
def swarm(tmp_path):
    """A scenario file: seven agents, and what is in its timeline."""

    def written(duration=0.5, timeline=()):
        text = (files("affinet.shipped") / "scenarios" / "corridor.toml").read_text()
        entries = "".join(f"\n[[timeline]]\n{entry}\n" for entry in timeline)
        file = tmp_path / "swarm.toml"
        file.write_text(
            f"{text}\n[record]\nenabled = false\n{entries}".replace("duration = 60.0", f"duration = {duration}")
        )
        return file

    return written


def endpoint(address="127.0.0.1", port=None):
    """Where to listen: at a port that is free."""
    if port is None:
        with socket.socket() as free:
            free.bind((address, 0))
            port = free.getsockname()[1]
    return f"tls/{address}:{port}"


def summary(out):
    return json.loads((out / "summary.json").read_text())


def flown(out):
    return summary(out)["messages"]["ticks"]


def hosts_file(folder, keys, listen, medium, *machines):
    lines = [f'listen = "{listen}"', f'medium = "{medium}"', f'keys = "{keys}"', 'scenario = "swarm.toml"']
    for machine in machines:
        lines += ["[[machines]]", f"affinet = {json.dumps(AFFINET)}"]
        lines += [f"{key} = {json.dumps(value)}" for key, value in machine.items()]
    file = folder / "hosts.toml"
    file.write_text("\n".join(lines))
    return file


TIMELINE = (
    'verb = "kill"\nat = 0.1\nagents = [2, 3, 5]',
    'verb = "restart"\nat = 0.2\nagents = [2, 3, 5]\nstate = "warm"',
    'verb = "pause"\nat = 0.3\nuntil = 0.35\nagents = [3, 4]',
)


def test_commands_started_from_a_file_fly_the_bits_of_one_machine(fleet, swarm, keys, tmp_path, out):
    file = swarm(timeline=TIMELINE)
    several = "agents.per_process=2"
    machines = {"name": "one", "agents": [1, 2, 3]}, {"name": "other", "agents": [4, 5]}
    hosts = hosts_file(tmp_path, keys, endpoint(), endpoint(), *machines)
    status, said = ended(fleet.start("hosts", hosts, "--out", out, "--set", several))
    assert status == 0, said
    assert summary(out)["digest"] == digest_of(str(file))
    processes = [process for process in summary(out)["processes"] if "machine" in process]
    where = {f"{process['role']} {process['id']}": process["machine"] for process in processes}
    assert where == {"host 1": "one", "agent 3": "one", "host 2": "other"}
    assert not fleet.running()


def typed(fleet, keys, scenario, out, listen, medium, *, to=lambda _: (), gone_after=20.0):
    """All commands of a run, as they are typed: the world on a, the medium and three agents on b, the others on c."""
    commands = {
        "world": ("a", "world", scenario, "--listen", listen, "--out", out, "--gone-after", gone_after),
        "netem": ("b", "netem", "--connect", listen, "--listen", medium),
        "some": ("b", "agent", 1, 2, 3, "--connect", listen),
        "others": ("c", "agent", 4, 5, 6, 7, "--connect", listen),
    }
    return {name: fleet.start(*words, "--keys", keys, to=to(machine)) for name, (machine, *words) in commands.items()}


def test_typed_on_three_machines_world_medium_and_agents_fly_the_bits_of_one(fleet, swarm, keys, out):
    file = swarm()
    with network("a", "b", "c") as machines:
        addresses = [endpoint(machines.address(name), PORT) for name in ("a", "b")]
        commands = typed(fleet, keys, file, out, *addresses, to=machines.to)
        for command in commands.values():
            status, said = ended(command)
            assert status == 0, said
        assert not any(map(machines.running, machines.names))
    assert summary(out)["digest"] == digest_of(str(file))
    assert summary(out)["verdict"] == "pass"
    clocks = [process["clock_uncertainty_s"] for process in summary(out)["processes"] if process["role"] == "agent"]
    assert len(clocks) == 7
    assert all(0.0 < uncertainty_s < 1.0 for uncertainty_s in clocks)


@pytest.mark.slow
def test_a_machine_that_is_cut_off_and_comes_back_goes_on_and_what_was_lost_is_counted(fleet, swarm, keys, out):
    file = swarm(duration=3.0)
    with network("a", "b", "c") as machines:
        addresses = [endpoint(machines.address(name), PORT) for name in ("a", "b")]
        commands = typed(fleet, keys, file, out, *addresses, to=machines.to)
        await_true(lambda: rows_of(out) > 0 or commands["world"].poll() is not None, "it never flew")
        machines.cut("c")
        await_true(lambda: not machines.connections("c"), "the cut was not noticed")
        machines.mend("c")
        for command in commands.values():
            status, said = ended(command)
            assert status == (command is commands["world"]), said
    assert summary(out)["digest"] == digest_of(str(file))
    lost = summary(out)["messages"]["transport_lost"]
    assert lost > 0
    assert summary(out)["verdict"] == f"pass, transport lost {lost}"
    table = journal.read(out / "journal.arrows")
    assert sum(sum(of_tick.values()) for of_tick in journal.lost(table).values()) == lost
    assert reading.evidence(out).outcome.verdict == summary(out)["verdict"]


def rows_of(out):
    """How many ticks the world has written down so far."""
    graph = out / "graph.arrows"
    return graph.stat().st_size if graph.exists() else 0


def awaiting_flight(out, commands):
    """Go on when it flies."""
    await_true(lambda: rows_of(out) > 0 or any(one.poll() is not None for one in commands.values()), "it never flew")


def typed_here(fleet, swarm, keys, out, **options):
    """All commands of a run that lasts, on this machine, in flight."""
    commands = typed(fleet, keys, swarm(duration=600.0), out, endpoint(), endpoint(), **options)
    awaiting_flight(out, commands)
    return commands


REAL = ("--set", 'time.mode="real"', "--set", "time.dt=0.05", "--set", "time.real.late=60")


def test_in_real_time_they_fly_by_one_clock(fleet, swarm, keys, tmp_path, out):
    swarm(duration=2.0)
    machines = {"name": "one", "agents": [1, 2, 3]}, {"name": "other", "agents": [4, 5], "netem": endpoint()}
    hosts = hosts_file(tmp_path, keys, endpoint(), endpoint(), *machines)
    status, said = ended(fleet.start("hosts", hosts, "--out", out, *REAL))
    assert status == 0, said
    told = summary(out)
    assert told["verdict"] == "pass"
    assert {f"agent {number}" for number in range(1, 8)} <= told["timing"]["lateness"].keys()
    assert told["timing"]["delays"]["messages"] > 0  # of the table that the medium wrote on another machine
    assert not fleet.running()


@pytest.mark.slow
def test_in_real_time_a_machine_that_is_cut_off_is_missed_and_comes_back(fleet, swarm, keys, tmp_path, out):
    swarm(duration=12.0)
    with network("a", "b") as machines:
        addresses = [endpoint(machines.address("a"), port) for port in (PORT, PORT + 1)]
        remote = {"name": "b", "agents": [4, 5, 6, 7], "command": machines.to("b")}
        hosts = hosts_file(tmp_path, keys, *addresses, remote)
        command = fleet.start("hosts", hosts, "--out", out, *REAL, to=machines.to("a"))
        await_true(lambda: kept_by(out, "agent 4") or command.poll() is not None, "it never flew")
        machines.cut("b")
        await_true(lambda: not machines.connections("b"), "the cut was not noticed")
        machines.mend("b")
        _, said = ended(command)
        assert not any(map(machines.running, machines.names))
    told = summary(out)
    assert told["verdict"].startswith("pass, transport lost "), said
    assert told["messages"]["dropped"]["unsaid"] > 0
    assert told["messages"]["ticks"] == 240
    acted = kept_by(out, "agent 4")
    assert np.diff(acted).max() > 10
    assert np.diff(kept_by(out, "agent 1")).max() < np.diff(acted).max() / 3  # who was not cut off flew on
    assert acted[-1] > 230


def kept_by(out, process):
    """The ticks of which a process has told how it kept its time."""
    file = out / timing.FILE
    if not (file.exists() and file.stat().st_size):
        return []
    rows = timing.read(file)
    return rows["tick"].to_numpy()[np.array(rows["process"].to_pylist()) == process].tolist()


@pytest.mark.slow
def test_when_the_coordinator_is_killed_its_machines_end_what_they_run(fleet, swarm, keys, out):
    commands = typed_here(fleet, swarm, keys, out)
    commands["world"].send_signal(signal.SIGKILL)
    for name in ("netem", "some", "others"):
        status, said = ended(commands[name])
        assert (status, "the coordinator has ended: nobody listens at 127.0.0.1 port" in said) == (1, True), said
    await_true(lambda: not fleet.running(), "something is left")
    assert journal.read(out / "journal.arrows") if (out / "journal.arrows").exists() else True


@pytest.mark.slow
def test_when_the_command_of_a_machine_is_killed_the_run_ends_and_names_it(fleet, swarm, keys, out):
    commands = typed_here(fleet, swarm, keys, out)
    commands["others"].send_signal(signal.SIGKILL)
    status, said = ended(commands["world"])
    assert status == 1
    assert f"agent 4 on {socket.gethostname()}" in said
    await_true(lambda: not fleet.running(), "something is left")
    assert flown(out) > 0
    assert len(history.load(out / history.ARRAYS)["error"]) > 0


@pytest.mark.slow
def test_a_machine_that_does_not_come_back_is_given_up_on_both_sides(fleet, swarm, keys, out):
    with network("a", "b", "c") as machines:
        addresses = [endpoint(machines.address(name), PORT) for name in ("a", "b")]
        commands = typed(fleet, keys, swarm(duration=600.0), out, *addresses, to=machines.to, gone_after=5.0)
        awaiting_flight(out, commands)
        machines.cut("c")
        status, said = ended(commands["world"])
        assert status == 1
        assert "agent 4 on" in said, (said, ended(commands["netem"]))
        assert "not heard of for 5 s, and given up" in said, said
        status, said = ended(commands["others"])
        assert (status, "the coordinator was not heard of for 5 s" in said) == (1, True), said
        await_true(lambda: not any(map(machines.running, machines.names)), "something is left")
    assert flown(out) > 0


@pytest.mark.slow
def test_a_process_that_is_killed_on_its_machine_is_named_with_it(fleet, swarm, keys, out):
    commands = typed_here(fleet, swarm, keys, out)
    victim = next(process for process in fleet.running() if process.name() == "agent 5")
    victim.kill()
    status, said = ended(commands["world"])
    assert status == 1
    assert f"agent 5 (pid {victim.pid} on {socket.gethostname()}) was killed by SIGKILL" in said
    assert [ended(commands[name])[0] for name in ("netem", "some", "others")] == [0, 0, 0]
    assert not fleet.running()


@pytest.mark.slow
def test_ctrl_c_at_the_coordinator_ends_all_in_order(fleet, swarm, keys, out):
    commands = typed_here(fleet, swarm, keys, out)
    commands["world"].send_signal(signal.SIGINT)
    assert ended(commands["world"])[0] == 130
    assert [ended(commands[name])[0] for name in ("netem", "some", "others")] == [0, 0, 0]
    assert not fleet.running()


def test_another_scenario_is_refused_in_a_line(fleet, swarm, keys, out):
    listen = endpoint()
    fleet.start("world", swarm(), "--listen", listen, "--keys", keys, "--out", out)
    other = fleet.start("agent", 1, "--connect", listen, "--keys", keys, "--scenario", "corridor")
    status, said = ended(other)
    assert status == 2
    assert "agent 1: agent-1 on" in said
    assert "has another scenario" in said
    assert len(said.splitlines()) == 1
