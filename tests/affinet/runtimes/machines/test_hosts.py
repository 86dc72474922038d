"""hosts.toml: who is on which machine, what is started there, and what is wrong in it."""

import sys

import pytest
from flying import plan_of

from affinet.runtimes.child import RunFailed
from affinet.runtimes.machines import hosts, seats
from affinet.runtimes.machines.commands import Command, Commands
from affinet.scenario.wrong import ScenarioError
from netem.wire.session import HUB

WHOLE = """
scenario = "corridor"
listen = "tls/10.0.0.1:7447"
keys = "keys"
[[machines]]
name = "b"
command = ["ssh", "user@b"]
netem = "tls/10.0.0.2:7448"
agents = [1, 2, 3]
[[machines]]
name = "c"
command = ["ip", "netns", "exec", "c"]
agents = [4, 5]
"""


def read(tmp_path, text=WHOLE):
    file = tmp_path / "hosts.toml"
    file.write_text(text)
    return hosts.load(file)


def test_each_machine_has_the_seats_that_the_file_gives_it(tmp_path):
    found = seats.spread_over(plan_of("corridor"), read(tmp_path))
    on_b = dict.fromkeys((HUB, "agent-1", "agent-2", "agent-3"), "b")
    assert found.machines == on_b | {"agent-4": "c", "agent-5": "c"}
    assert [commands for _, commands in found.of_machines] == [
        (("netem", "--listen", "tls/10.0.0.2:7448"), ("agent", "1", "2", "3")),
        (("agent", "4", "5"),),
    ]


def test_who_is_carried_together_is_on_one_machine(tmp_path):
    found = seats.spread_over(plan_of("corridor", "agents.per_process=2"), read(tmp_path))
    assert found.machines == {HUB: "b", "host-1": "b", "agent-3": "b", "host-2": "c"}
    assert seats.hosts_of(plan_of("corridor", "agents.per_process=2"), (), found.groups) == {
        1: (1, 2),
        2: (4, 5),
        3: (6, 7),
    }


def test_by_hand_all_but_the_world_is_elsewhere():
    assert dict.fromkeys((HUB, "host-1", "host-2", "agent-7")) == (
        seats.by_hand(plan_of("corridor", "agents.per_process=3")).machines
    )


def test_the_medium_listens_at_the_next_port_unless_it_is_said(tmp_path):
    assert read(tmp_path).medium_listens == "tls/10.0.0.1:7448"
    assert read(tmp_path, f'medium = "tls/[::1]:9"{WHOLE}').medium_listens == "tls/[::1]:9"


WRONG = {
    "no machine": (WHOLE.partition("[[")[0], "machines: is missing"),
    "a key of nobody": (f"lisen = 1{WHOLE}", "lisen: unknown key; did you mean 'listen'?"),
    "twice there": (WHOLE.replace("[4, 5]", "[3, 5]"), "agent 3 stands there twice"),
    "two media": (f'{WHOLE}netem = "tls/10.0.0.3:1"\n', "the medium is on one machine"),
    "no TLS": (
        WHOLE.replace("tls/10.0.0.1", "tcp/10.0.0.1"),
        "is no address for several machines: write tls/ADDRESS:PORT",
    ),
    "no patience": (f"gone_after = 0{WHOLE}", "gone_after: should be"),
    "an agent of nobody": (
        WHOLE.replace("[4, 5]", "[4, 9]"),
        "machines[1].agents: there is no agent 9: the scenario has 7",
    ),
    "no TOML": ("listen", "not TOML"),
}


@pytest.mark.parametrize(("text", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_said_in_a_line_with_file_and_key(tmp_path, text, says):
    with pytest.raises(ScenarioError) as error:
        seats.spread_over(plan_of("corridor"), read(tmp_path, text))
    assert str(error.value).startswith("hosts.toml")
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_a_scenario_has_to_be_named(tmp_path):
    nameless = read(tmp_path, WHOLE.replace('scenario = "corridor"', ""))
    with pytest.raises(ScenarioError, match=r"hosts.toml:?\d*: scenario: is missing; name one here"):
        nameless.scenario_from(tmp_path)


def heeded_for_ever(commands):
    while True:
        commands.heed()


def test_a_command_that_ends_is_named_with_its_last_words(tmp_path):
    words = (sys.executable, "-c", "print('no way to b'); raise SystemExit(7)")
    with Commands([Command("b", words)], tmp_path / "logs") as commands, pytest.raises(RunFailed) as error:
        heeded_for_ever(commands)
    assert str(error.value).startswith("machine b: ")
    assert str(error.value).endswith("ended with exit status 7: no way to b")


def test_a_command_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="no-such-way"), Commands([Command("b", ("no-such-way",))], tmp_path):
        pass
