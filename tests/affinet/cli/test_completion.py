"""`affinet completion`: what a shell makes of it."""

import shutil
import subprocess

import pytest
from paths import DOCS

from affinet.cli import options
from affinet.cli.commands import main
from affinet.cli.helping import commands_of
from affinet.cli.options.beginning import SHELLS
from affinet.scenario import files

BASH = """
source affinet.bash
COMP_WORDS=(affinet "$@")
COMP_CWORD=$#
function=$(complete -p affinet | grep -o -- '-F [^ ]*' | cut -d' ' -f2)
$function affinet "${COMP_WORDS[COMP_CWORD]}"
printf '%s\\n' "${COMPREPLY[@]}"
"""


def script(shell, capsys):
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        (("de",), {"design"}),
        (("run", "b"), {"bursts"}),
        (("run", "m"), {"mine.toml"}),
        (("run", "corridor", "--estimator", "r"), {"rkf", "ral"}),
        (("study", "paper-003"), {"paper-003"}),
        (("replay", ""), {"runs/one", "runs/two"}),
        (("list", "est"), {"estimators"}),
        (("run", "--se"), {"--set", "--seed", "--seeds", "--serve"}),
        (("new", "p"), {"project"}),
    ],
)
def test_bash_completes(typed, completed, tmp_path, capsys):
    (tmp_path / "affinet.bash").write_text(script("bash", capsys))
    (tmp_path / "mine.toml").touch()
    for run in ("one", "two"):
        (tmp_path / "runs" / run).mkdir(parents=True)
    done = subprocess.run(
        ["bash", "-c", BASH, "bash", *typed], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert set(done.stdout.split()) == completed
    assert done.stderr == ""


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_says_where_it_goes_as_the_docs_do(shell, capsys):
    (line,) = [
        line for line in (DOCS / "commands.md").read_text().splitlines() if f"affinet completion {shell}" in line
    ]
    said = script(shell, capsys)
    assert f"# {line.strip()}\n" in said
    assert "Usage:" not in said


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_has_all_commands_and_names(shell, capsys):
    said = script(shell, capsys)
    assert [word for word in commands_of(options.parser()) if word not in said] == []
    assert [name for name in files.shipped("scenarios") if name not in said] == []
    assert "ga-rkf" in said
    assert "runs/" in said


def test_another_shell_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["completion", "tcsh"])
    assert "bash, zsh, fish" in capsys.readouterr().err.replace("'", "")
