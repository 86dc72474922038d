"""What a command line varies from run to run: settings that are swept, and seeds."""

from __future__ import annotations

import argparse

from affinet.cli.given import overrides
from affinet.scenario.overrides import read
from affinet.scenario.wrong import ScenarioError
from affinet.studies import sweeping


def swept(parsed: argparse.Namespace) -> list[tuple[str, list[str]]]:
    """Keys with their values, each said once.

    Raises
    ------
    ScenarioError
        When a key, or the seed, is said twice: one would be dropped for the other.
    """
    fixed = overrides(parsed)
    if parsed.seeds is not None and any(one.key == "seed" for one in read(fixed)):
        raise ScenarioError("--seeds and a seed: give the one or the other")
    sweeping.refuse_twice(parsed.sweep, fixed)
    return [sweeping.values_of(sweep) for sweep in parsed.sweep]
