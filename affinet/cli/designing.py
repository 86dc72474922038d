"""`affinet design`: a large formation, as a scenario."""

from __future__ import annotations

import argparse
from pathlib import Path

from affinet.cli import show
from affinet.planning import designing
from affinet.runtimes import directories
from affinet.scenario import loading
from netem.processes.system_errors import about


def design(parsed: argparse.Namespace) -> None:
    """Design it, and write it.

    Raises
    ------
    ScenarioError, OSError
        When there is none for these nodes, or the file cannot be written.
    """
    nominal = designing.nodes(parsed.nodes, parsed.agents, parsed.dimension, parsed.seed)
    made = designing.designed(nominal, parsed.range, parsed.settle)
    file = directories.for_design(parsed.out or Path(parsed.nodes).stem)
    with directories.unless_empty(file), about(file):
        file.write_text(loading.to_toml(made.scenario), encoding="utf-8")
    show.designed(made, file)
