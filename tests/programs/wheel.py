"""The wheel is a good neighbour: built, installed beside openai-agents, and used from a project with an `agents/` of its own.

    python tests/programs/wheel.py [WHEEL]

Builds the wheel from the repository and from its sdist, unless one is given, and flies it by command, pytest and Python, in
process and over processes: the bits are those of this checkout. The exit status is 1 when anything failed.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
TAKEN = ("agents", "analysis", "netem", "world")  # by the project
SHORT = ("--duration", "0.5", "--set", "record.enabled=false")

OWN = 'WHOSE = "the project"\n'
FAILS = "def measured(array):\n    raise ZeroDivisionError(array.shape)\n"
TEST = """\
import agents
import analysis
import netem
import world
from affinet import bounded


def test_a_users_estimator_flies_beside_modules_of_the_users_own(swarm):
    assert {module.WHOSE for module in (agents, analysis, netem, world)} == {"the project"}
    run = swarm("corridor", 'agents.estimator="agents.held:HoldLast"', "time.duration=0.5").fly().check(bounded(100.0))
    assert run.outcome.digest == "DIGEST"
"""
PROGRAM = """\
import json
import sys

import agents
import world

import affinet

assert {agents.WHOSE, world.WHOSE} == {"the project"}
run = affinet.run("corridor", 'agents.estimator="agents.held:HoldLast"', "time.duration=0.5", runtime=sys.argv[1])
print(json.dumps({"digest": run.outcome.digest}))
"""
NEIGHBOUR = """\
import agents
import affinet

assert agents.Agent and agents.Runner and affinet.Estimate.__module__ == "affinet.agents.estimate"
print(agents.__file__)
"""


class Failed(Exception):
    """A step that did not come out as it has to."""


def strangers(wheel: Path) -> set[str]:
    """What a wheel holds at the top beside `affinet` and what is said of it."""
    tops = {name.partition("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    return {top for top in tops if top != "affinet" and not re.fullmatch(r"affinet-[^/]+\.dist-info", top)}


def refuse_strangers(wheel: Path) -> None:
    """A wheel of affinet has no name but its own."""
    if found := strangers(wheel):
        raise Failed(f"{wheel.name} takes the names {', '.join(sorted(found))}, which others have")


def built(folder: Path) -> Path:
    """The wheel, as it is built from the repository; from the sdist, and by pip, it has to be the same."""
    _run([uv(), "build", "--quiet", "--wheel", "--out-dir", folder / "repository", ROOT])
    _run([uv(), "build", "--quiet", "--out-dir", folder / "sdist", ROOT])
    # pip gives the builder other hooks than uv does: once it could not import what it asked for.
    _run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder / "pip", ROOT])
    wheel, *others = (next((folder / name).glob("*.whl")) for name in ("repository", "sdist", "pip"))
    files = contents(wheel)
    for other in others:
        if differ := sorted(name for name, _ in files.items() ^ contents(other).items()):
            raise Failed(
                f"built by way of {other.parent.name} the wheel has other files: {', '.join(dict.fromkeys(differ))}"
            )
    return wheel


def contents(wheel: Path) -> dict[str, bytes]:
    """The files of a wheel."""
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def installed(wheel: Path, folder: Path) -> Path:
    """The programs of a new environment with the wheel and openai-agents, and the releases of the lock for all else."""
    lock, environment = folder / "constraints.txt", folder / "venv"
    exported = [uv(), "export", "--quiet", "--frozen", "--no-hashes", "--no-emit-project", "--group", "test"]
    lock.write_text(_run([*exported, "--project", ROOT]))
    _run([uv(), "venv", "--quiet", "--python", sys.executable, environment])
    wanted: list[str | Path] = [wheel, "openai-agents", "pytest", "pytest-timeout"]
    _run(
        [
            uv(),
            "pip",
            "install",
            "--quiet",
            "--compile-bytecode",
            "--python",
            environment,
            "--constraint",
            lock,
            *wanted,
        ]
    )
    return environment / "bin"


def project(folder: Path, digest: str) -> Path:
    """A project whose modules are called like the rooms, with the estimator of the docs in one."""
    home = folder / "project"
    (home / "agents").mkdir(parents=True)
    (home / "agents" / "__init__.py").write_text(OWN)
    (home / "agents" / "held.py").write_text(estimator())
    for name in TAKEN[1:]:
        (home / f"{name}.py").write_text(OWN)
    with (home / "world.py").open("a") as file:
        file.write(FAILS)
    helped = estimator().replace(
        "np.where(seen[..., None], measured,", "np.where(seen[..., None], world.measured(measured),"
    )
    (home / "agents" / "helped.py").write_text(f"import world\n{helped}")
    (home / "test_swarm.py").write_text(TEST.replace("DIGEST", digest))
    (home / "program.py").write_text(PROGRAM)
    return home


def estimator() -> str:
    """That of docs/estimators.md."""
    (code,) = re.findall(
        r"```python\n(# held\.py.*?)```", (ROOT / "docs" / "estimators.md").read_text(), flags=re.DOTALL
    )
    return str(code)


def of_the_checkout(folder: Path, name: str) -> str:
    """The digest of a flight in this checkout, in process."""
    (folder / "held.py").write_text(estimator())
    return digest([sys.executable, "-m", "affinet"], "inprocess", name, folder)


def digest(command: Sequence[str | Path], runtime: str, name: str, folder: Path) -> str:
    """The digest of a flight by command, with this estimator, from a folder."""
    with tempfile.TemporaryDirectory() as out:
        options = ["--runtime", runtime, "--out", f"{out}/run", "--json", "--estimator", name, *SHORT]
        return _digest(_run([*command, "run", "corridor", *options], folder))


def same(wanted: str, found: str, what: str) -> None:
    """Two flights have the same bits."""
    if found != wanted:
        raise Failed(f"{what}: digest {found}, and {wanted} in the checkout")


def tried(wheel: Path, folder: Path) -> None:
    """Everything a user may do with the wheel."""
    refuse_strangers(wheel)
    shipped, own = (of_the_checkout(folder, name) for name in ("ga-rkf", "held:HoldLast"))
    programs, home = installed(wheel, folder), project(folder, own)
    command, module = [programs / "affinet"], [programs / "python", "-m", "affinet"]
    versions = {_run([*one, "--version"], home) for one in (command, module)}
    if versions != {f"affinet {wheel.name.split('-')[1]}\n"}:
        raise Failed(f"--version says {versions}")
    failing = _run([*command, "check", "corridor", "--estimator", "agents.helped:HoldLast"], home, status=3)
    if f"({home / 'world.py'}:3)" not in failing:
        raise Failed(f"what failed in line 3 of the user's world.py is said as {failing}")
    for runtime in ("inprocess", "processes"):
        same(shipped, digest(command, runtime, "ga-rkf", home), f"affinet run, {runtime}")
        same(own, digest(module, runtime, "agents.held:HoldLast", home), f"python -m affinet run, {runtime}")
        same(own, _digest(_run([programs / "python", "program.py", runtime], home)), f"affinet.run, {runtime}")
        _run([programs / "python", "-m", "pytest", "-q", f"--affinet-runtime={runtime}"], home)
    scaffolded(programs, folder)
    file = Path(_run([programs / "python", "-P", "-c", NEIGHBOUR], folder).strip())
    if file.parent.parent.name != "site-packages":
        raise Failed(f"agents is {file}, and not that of openai-agents")


def scaffolded(programs: Path, folder: Path) -> None:
    """A project of `affinet new` passes, flies over processes, and offers its estimator everywhere once it is installed."""
    _run([programs / "affinet", "new", "project", "my-swarm"], folder)
    home, bits = folder / "my-swarm", []
    _run([programs / "python", "-m", "pytest", "-q"], home)
    for runtime in ("inprocess", "processes"):
        options = [
            "--runtime",
            runtime,
            "--out",
            f"runs/{runtime}",
            "--json",
            "--duration",
            "1",
            "--set",
            "timeline=[]",
        ]
        bits.append(_digest(_run([programs / "affinet", "run", "swarm.toml", *options], home)))
    same(bits[0], bits[1], "the scaffolded project over processes")
    _run([uv(), "pip", "install", "--quiet", "--python", programs.parent, "--no-deps", home])
    said = json.loads(_run([programs / "affinet", "list", "estimators", "my-swarm-filter", "--json"], folder))
    (offered,) = said["estimators"]
    if (offered["package"], offered["parameters"][0]["name"]) != ("my-swarm", "gain"):
        raise Failed(f"an installed estimator is listed as {offered}")
    digest([programs / "affinet"], "processes", "my-swarm-filter", folder)


def uv() -> str:
    """The command: beside this Python, or on the path."""
    found = shutil.which("uv", path=os.pathsep.join([str(Path(sys.executable).parent), *os.get_exec_path()]))
    if found is None:
        raise Failed("there is no uv: `make` installs it")
    return found


def _digest(said: str) -> str:
    return str(json.loads(said.splitlines()[-1])["digest"])


def _run(command: Sequence[str | Path], folder: Path = ROOT, status: int = 0) -> str:
    """What a command prints; with another exit status than this it failed."""
    told = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    told["UV_PYTHON_DOWNLOADS"] = "never"
    done = subprocess.run(command, cwd=folder, env=told, capture_output=True, text=True, check=False)
    if done.returncode != status:
        shown = " ".join(map(str, command))
        raise Failed(f"{shown}: exit status {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout if status == 0 else done.stderr


def main(arguments: Sequence[str]) -> int:
    """Try it, and say what failed."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="affinet-wheel-") as folder:
        try:
            tried(Path(arguments[0]).absolute() if arguments else built(Path(folder)), Path(folder))
        except Failed as failed:
            print(f"the wheel FAILED: {failed}", file=sys.stderr)
            return 1
    print(f"the wheel passed, {time.perf_counter() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
