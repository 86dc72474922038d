"""Figs. 5 and 6 of paper 002, of one run of each case of the study `paper-002-fig456`: docs/pictures/paper-002-fig56.png.

python docs/draw_agreement.py     # some minutes
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import tomli_w

from affinet.scenario import files

PICTURE = Path(__file__).parent / "pictures" / "paper-002-fig56.png"
_STUDY = "paper-002-fig456"


def study() -> str:
    """The study with another figure, of one run, and without claims, which want more."""
    says = dict(files.read(_STUDY, "studies", "study").says)
    del says["claims"]
    return tomli_w.dumps(says | {"figure": "paths", "full": {**says["full"], "runs": 1}})


def main() -> None:
    """Fly it, and keep its figure."""
    with TemporaryDirectory() as folder:
        file = Path(folder, "agreement.toml")
        file.write_text(study(), encoding="utf-8")
        flown = ["study", str(file), "--out", str(Path(folder, "flown"))]
        subprocess.run([sys.executable, "-m", "affinet", *flown], check=True)
        shutil.copy(Path(folder, "flown", "figure.png"), PICTURE)


if __name__ == "__main__":
    main()
