"""`affinet fit`: an autoregressive model of the inputs of a run."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from affinet.studies import fit as fits


def fit(parsed: argparse.Namespace) -> None:
    """Fit it, and print it.

    Raises
    ------
    ScenarioError, Damaged
        When there is no such run, or it does not say enough.
    """
    model = fits.inputs(parsed.directory, parsed.order)
    print(json.dumps(asdict(model)) if parsed.json else "\n".join(fits.overrides(model)))  # noqa: T201
