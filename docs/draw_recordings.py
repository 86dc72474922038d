"""The pictures of recordings in docs/pictures, as a viewer without a screen draws them: with a Vulkan driver, like lavapipe.

    python docs/draw_recordings.py [--only corridor ...] [--out docs/pictures]

Each scenario is flown in one process, and shown at one moment. `film` is the film of the README, and `tutorial` has the
pictures that the commands of docs/tutorial.md draw, which take no viewer.
"""

from __future__ import annotations

import argparse
import io
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from rerun.experimental import ViewerClient

from affinet.cli import commands as cli
from affinet.planning import making
from affinet.runtimes.rerun_command import command
from affinet.runtimes.run import fly
from affinet.runtimes.viewers import free_port
from affinet.scenario import loading
from netem.core.parts import parts

_HERE = Path(__file__).parent
_MOMENTS = {  # of each shipped scenario one, in seconds
    "bursts": 22.0,
    "corridor": 22.0,
    "hexa": 22.0,
    "localization": 0.4,
    "partition": 9.8,
    "ravine": 20.0,
    "rigid": 12.0,
    "switching": 25.0,
    "target": 4.0,
}
_LOOKS = 200
_EMPTY = 60_000  # bytes, that a window without a swarm has


@contextmanager
def viewer() -> Iterator[ViewerClient]:
    """A viewer without a screen, on loopback."""
    port = free_port()
    words = [command(), "--bind", "127.0.0.1", "--port", str(port), "--headless", "--hide-welcome-screen"]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            yield _connected(f"rerun+http://127.0.0.1:{port}/proxy", process)
        finally:
            process.terminate()


def _connected(url: str, process: subprocess.Popen[bytes]) -> ViewerClient:
    while process.poll() is None:
        try:
            return ViewerClient.connect(url)
        except Exception:  # noqa: BLE001 - it is not there yet, which the library says in several ways
            continue
    raise RuntimeError("the viewer ended at once: is there a Vulkan driver (mesa-vulkan-drivers)?")


def picture(files: Sequence[Path], seconds: float) -> bytes:
    """What recordings show at a moment, once it does not change any more."""
    with viewer() as shown:
        shown.open([str(file.absolute()) for file in files])
        before = b""
        for _ in range(_LOOKS):
            if shown.get_state().views:
                shown.set_time("sim_time", duration=seconds, play_state="paused")
                now = shown.take_screenshot()
                if now == before and len(now) > _EMPTY:
                    return now
                before = now
        raise RuntimeError(f"the picture did not come to rest in {_LOOKS} looks")


def flown(out: Path, name: str, *overrides: str) -> Path:
    """The directory of a run."""
    fly(making.make(loading.load(name, overrides)), "inprocess", out, lambda *_: None)
    return out


def film(folder: Path, path: Path) -> None:
    """GA-RKF and RKF in the same bursts of losses."""
    shown = {"GA-RKF": "ga-rkf", "RKF": "rkf"}
    runs = [flown(folder / name, "bursts", f"agents.estimator={estimator}") for name, estimator in shown.items()]
    command = ["render", *map(str, runs), "--to", "30", "--speed", "5", "--fps", "10", "--out", str(folder / path.name)]
    if cli.main(command):
        raise RuntimeError("no film was made")
    shutil.copy(folder / path.name, path)


def tutorial(folder: Path, pictures: Path) -> None:
    """What the commands of docs/tutorial.md draw."""
    names = ("ga-rkf", "rkf")
    runs = [str(flown(folder / name, "bursts", f"agents.estimator={name}", "time.duration=20")) for name in names]
    for words in (
        ["compare", *runs, "--out", str(pictures / "tutorial-errors.png")],
        ["render", *runs, "--at", "18", "--out", str(pictures / "tutorial-moment.png")],
    ):
        if cli.main(words):
            raise RuntimeError(f"no picture was made by {words[0]}")


def main() -> None:
    """Fly, and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    everything = ["film", "tutorial", *_MOMENTS]
    parser.add_argument("--only", nargs="+", choices=everything, default=everything)
    parser.add_argument("--out", type=Path, default=_HERE / "pictures")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in given.only:
            if name == "film":
                film(Path(folder), given.out / "bursts.gif")
                continue
            if name == "tutorial":
                tutorial(Path(folder), given.out)
                continue
            out = flown(Path(folder) / name, name)
            shot = Image.open(io.BytesIO(picture(parts(out / "run.rrd"), _MOMENTS[name])))
            shot.convert("RGB").quantize(256).save(given.out / f"recording-{name}.png", optimize=True)


if __name__ == "__main__":
    main()
