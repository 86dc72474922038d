"""The page about several machines: its file can be read, its commands typed, and its table has every key."""

import re
import shlex

import pytest
from paths import ROOT

from affinet.cli import options
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
