"""Help: a command alone says what one does next, and the examples that help ends with do what they say."""

import shlex

import pytest
from flying import PROCESSES, plan_of

from affinet.cli import options
from affinet.cli.commands import main
from affinet.cli.examples import EXAMPLES, NEXT
from affinet.cli.helping import commands_of, shown
from affinet.runtimes.run import fly

pytestmark = PROCESSES

ALL = [example for examples in EXAMPLES.values() for example in examples]
RUN = [example for example in ALL if example.alone]
PINGS = "".join(f"64 bytes from b: icmp_seq={number} time=4 ms\n" for number in range(1, 100) if number % 11 > 1)


def typed(example, more=""):
    program, *words = shlex.split(example.line.partition(" > ")[0], comments=True)
    assert program == "affinet"
    return [*words, *shlex.split(more)]


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    out = tmp_path_factory.mktemp("kept") / "run"
    fly(plan_of("corridor", "time.duration=0.5", "record.enabled=false"), "inprocess", out, lambda *_: None)
    return out


@pytest.mark.parametrize("example", RUN, ids=lambda example: example.line)
def test_an_example_does_what_it_says(example, kept, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "kept").symlink_to(kept)
    if "mine.toml" in example.line:
        assert main(["new", "study", "mine"]) == 0
    (tmp_path / "pings.txt").write_text(PINGS)
    assert main(typed(example, example.short)) == example.status, capfd.readouterr().err
    assert capfd.readouterr().out


@pytest.mark.parametrize("example", [*ALL, *NEXT], ids=lambda e: e.line)
def test_an_example_can_be_typed(example):
    assert options.parser().read(typed(example)).command == example.line.split()[1]


def test_every_command_ends_its_help_with_its_own_examples():
    assert list(EXAMPLES) != []
    for name, command in commands_of(options.parser()).items():
        assert {example.line.split()[1] for example in EXAMPLES[name]} == {name}
        assert command.format_help().endswith(f"examples:\n{shown(EXAMPLES[name])}\n")
    assert commands_of(options.parser()).keys() == EXAMPLES.keys()


def test_the_command_alone_says_what_one_does_next(capfd):
    assert main([]) == 2
    out, said = capfd.readouterr()
    assert out == ""
    steps = [line.split()[1] for line in said.splitlines() if line.startswith("  affinet ")]
    assert steps == [step.line.split()[1] for step in NEXT if step.line.split()[1] in EXAMPLES]
    assert {"check", "run", "list", "new", "study"} <= set(steps)
    assert "`affinet --help` lists all commands." in said


def test_help_fits_a_screen():
    for command in commands_of(options.parser()).values():
        assert max(map(len, command.format_help().splitlines())) <= 130
