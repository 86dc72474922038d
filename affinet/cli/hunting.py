"""`affinet hunt`: what a person sees of it, and the scenarios that it leaves."""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from affinet.cli import certified, frontiers, hunted
from affinet.cli.given import scenario
from affinet.cli.notes import note
from affinet.cli.quarry import confirm, flown_by, places_of, quarry_of, write
from affinet.cli.status import FAIL, PASS
from affinet.planning import making as planning
from affinet.planning.plan import PlanError
from affinet.runtimes import directories
from affinet.scenario.wrong import ScenarioError
from affinet.testing import corpus, hunt
from affinet.testing.corpus import Found
from affinet.testing.hunt import Quarry
from affinet.testing.trial import Trial

_BUDGET = 100


def hunt_and_report(parsed: argparse.Namespace) -> int:
    """Hunt, and say what was found; to find something is to fail.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, OSError
        When the hunt cannot begin, or what it finds not be written.
    """
    if parsed.every is not None:
        return certified.fly_and_certify(parsed)
    if parsed.certificate:
        raise ScenarioError("--certificate: one is left of all faults of a class; say of which with --every")
    if parsed.frontier:
        return frontiers.fly_and_draw(parsed)
    quarry, trials = _with_corpus(parsed, quarry_of(parsed))
    places = places_of(parsed, quarry)
    budget = parsed.budget or _BUDGET
    with ExitStack() as claimed:
        for file in places:
            claimed.enter_context(directories.unless_empty(file))
        with hunted.Progress(budget) as chase:
            found = hunt.hunt(
                quarry,
                budget=budget,
                seed=next(iter(quarry.scenarios.values())).seed,
                watch=chase.see,
                each=flown_by(parsed.jobs),
                corpus=trials,
            )
        for one in found.found:
            write(one.scenario, places[one.number])
    if parsed.corpus:
        new = corpus.keep(parsed.corpus, Path(parsed.scenario).stem, found.worth)
        note(f"{parsed.corpus}: {len(trials)} flown first, {new} new")
    hunted.show(found, [one.name for one in quarry.make()], quarry)
    for one in found.found:
        confirm(one, quarry, places[one.number])
    if parsed.json:
        print(json.dumps(hunted.as_json(found, places, quarry)))  # noqa: T201
    coverage = found.coverage
    if not found.found and coverage.vacuous + coverage.unfit >= coverage.schedules:
        note("nothing was put to the test: in every schedule a fault touched nothing, or an invariant could not tell")
        return FAIL
    return FAIL if found.found else PASS


def _with_corpus(parsed: argparse.Namespace, quarry: Quarry) -> tuple[Quarry, list[Trial]]:
    """The trials of the corpus that fit the scenario and hold undisturbed, and their settings; others are told of."""
    known = dict[str, Found]()
    for one in corpus.read(parsed.corpus) if parsed.corpus else ():
        try:
            if one.trial.settings not in {**quarry.scenarios, **quarry.beyond}:
                settings = {one.trial.settings: scenario(parsed, one.trial.settings)}
                quarry = replace(quarry, beyond={**quarry.beyond, **settings})
            planning.make(one.trial.in_scenario(quarry.case(one.trial).given))
        except (ScenarioError, PlanError) as error:
            note(f"{one.file}: left out, as it does not fit {parsed.scenario}: {error}")
            continue
        known[one.trial.key] = one
    pairs = [(one.trial.settings, one.trial.seed) for one in known.values()]
    failing = hunt.failing_undisturbed(quarry, pairs, flown_by(parsed.jobs)) if pairs else []
    for one, finding in zip(list(known.values()), failing, strict=True):
        if finding is not None:
            note(f"{one.file}: left out, as its seed and settings fail with no fault at all: {finding}")
            del known[one.trial.key]
    return quarry, [one.trial for one in known.values()]
