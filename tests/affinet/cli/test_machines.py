"""The page about several machines: its file can be read, its commands typed, and its table has every key."""

import re
import shlex

import pytest
from paths import ROOT

from affinet.cli import options
from affinet.cli.commands import main
from affinet.runtimes.machines import hosts
from affinet.runtimes.machines.hosts import Hosts, Machine

PAGE = (ROOT / "docs" / "machines.md").read_text()
TOML = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
COMMANDS = re.findall(r"^    (affinet .*)$", PAGE, flags=re.MULTILINE)


def test_the_file_on_the_page_is_one(tmp_path):
    (file,) = TOML
    (tmp_path / "hosts.toml").write_text(file)
    read = hosts.load(tmp_path / "hosts.toml")
    assert [machine.name for machine in read.machines] == ["b", "c"]


WRONG = {
    "nonsense": "'nonsense' is no address for several machines: write tls/ADDRESS:PORT\n",
    "tls/127.0.0.1:99999": "'tls/127.0.0.1:99999' is no address for several machines: write tls/ADDRESS:PORT\n",
    "tls/203.0.113.1:7447": "tls/203.0.113.1:7447: this machine cannot listen there: Cannot assign requested address\n",
}


@pytest.mark.parametrize("command", ["world corridor", "netem --connect tls/127.0.0.1:7447"])
@pytest.mark.parametrize("listen", WRONG)
def test_where_this_machine_cannot_listen_is_said_before_anything_begins(
    listen, command, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert main([*command.split(), "--listen", listen, "--keys", "keys"]) == 2
    assert capsys.readouterr() == ("", WRONG[listen])
    assert list(tmp_path.iterdir()) == []


def test_its_commands_are_those_that_there_are():
    assert {command.split()[1] for command in COMMANDS} >= {"keys", "hosts", "world", "netem", "agent"}


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_on_the_page_can_be_typed(command):
    assert options.parser().parse_args(shlex.split(command)[1:]).command


def test_the_table_has_every_key_with_its_default():
    rows = dict(re.findall(r"^\| `([a-z_.]+)` \|.*\| (.*) \|$", PAGE, flags=re.MULTILINE))
    of = dict(Hosts.model_fields)
    of |= {f"machines.{name}": field for name, field in Machine.model_fields.items()}
    assert rows.keys() == of.keys()
    for name, field in of.items():
        if field.is_required():
            assert rows[name].startswith("**required**"), name
        elif isinstance(field.default, float | str):
            assert rows[name] in (f"`{field.default}`", f'`"{field.default}"`'), name
