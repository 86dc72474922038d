"""Every Python of this machine that affinet is for: set-up by the lock, the demo, and the tests that depend on it most.

    python tests/programs/pythons.py

Takes `python3.N` from the path and from pyenv, N from 11 on, one of each N; each gets an environment `.venv-3.N` of its own.
The exit status is 1 when anything failed.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
OLDEST = 11
TESTS = ("tests/netem/wire/test_wire.py", "tests/agents/test_bits.py", "tests/system/test_runtimes.py")
_NAME = re.compile(r"python3\.(\d+)")
_VERSION = "import sys, venv; print('.'.join(map(str, sys.version_info[:3])))"


def found() -> dict[int, tuple[str, Path]]:
    """Version and interpreter of each minor version there is; what does not start, like a shim of pyenv, is none."""
    interpreters: dict[int, tuple[str, Path]] = {}
    for candidate in _candidates():
        minor = int(candidate.name.removeprefix("python3."))
        if minor >= OLDEST and minor not in interpreters:
            said = subprocess.run([candidate, "-c", _VERSION], capture_output=True, text=True, check=False)
            if said.returncode == 0:
                interpreters[minor] = (said.stdout.strip(), candidate)
    return dict(sorted(interpreters.items()))


def _candidates() -> Iterator[Path]:
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    folders = [Path(folder) for folder in os.get_exec_path()] + sorted(pyenv.glob("versions/*/bin"))
    for folder in folders:
        names = sorted(os.listdir(folder)) if folder.is_dir() else []
        yield from (folder / name for name in names if _NAME.fullmatch(name) and os.access(folder / name, os.X_OK))


def tried(minor: int, interpreter: Path) -> str | None:
    """Which step failed, or None."""
    environment = ROOT / f".venv-3.{minor}"
    programs = environment / "bin"
    with tempfile.TemporaryDirectory() as folder:
        steps: dict[str, list[str | Path]] = {
            "environment": [interpreter, "-m", "venv", environment],
            "set-up": [
                *(ROOT / ".venv/bin/uv", "sync", "--locked", "--quiet", "--compile-bytecode"),
                *("--python", programs / "python"),
            ],
            "demo": [programs / "affinet", "run", "corridor", "--duration", "1", "--out", f"{folder}/run"],
            "tests": [programs / "pytest", "-n", "0", "-q", *TESTS],
        }
        for name, command in steps.items():
            told = os.environ | {"UV_PROJECT_ENVIRONMENT": str(environment), "UV_PYTHON_DOWNLOADS": "never"}
            if subprocess.run(command, cwd=ROOT, env=told, check=False).returncode:
                return name
    return None


def main() -> int:
    """Try them all, and say which there were."""
    interpreters, outcomes = found(), []
    for minor, (version, interpreter) in interpreters.items():
        print(f"== Python {version}: {interpreter}", flush=True)
        began = time.perf_counter()
        failed = tried(minor, interpreter)
        outcomes.append((failed, f"Python {version}: {failed or 'all'} {'FAILED' if failed else 'passed'}"))
        print(f"{outcomes[-1][1]}, {time.perf_counter() - began:.0f} s", flush=True)
    print("\n".join(["== Pythons tried", *(says for _, says in outcomes)]))
    if not outcomes:
        print(f"no Python from 3.{OLDEST} on was found in the path or under pyenv", file=sys.stderr)
    if len(outcomes) == 1:
        print("only one Python was found: no other was tried")
    return 0 if outcomes and not any(failed for failed, _ in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
