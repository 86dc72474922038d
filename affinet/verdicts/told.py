"""A run in a few lines: what flew, what came of it, and what its faults touched."""

from __future__ import annotations

from affinet.scenario.words import one_line
from affinet.verdicts.evidence import Evidence
from netem.core.listing import listed

_MOST_FAULTS = 3


def title(run: Evidence) -> str:
    """Which scenario, and the verdict."""
    return f"{one_line(run.plan.scenario.source.file)}, {run.outcome.says}"


OF_PASS = (
    "pass: every number is finite, every message accounted for, every fault touched something. "
    "Whether the error is small enough, a --check says."
)


def rows(run: Evidence, most_faults: int = _MOST_FAULTS) -> list[tuple[str, str]]:
    """Its figures, each with its name.

    Parameters
    ----------
    run
        Which.
    most_faults
        How many faults have a line each.
    """
    done, scenario, world = run.outcome, run.plan.scenario, run.plan.world
    network, messages = scenario.network, done.messages
    dropped = [f"{reason} {number}" for reason, number in messages["dropped"].items()]
    profile = "" if network.profile == "perfect" else f", profile {one_line(network.profile)}"
    faults = [("fault", one_line(str(bite))) for bite in done.faults[:most_faults]]
    if more := len(done.faults) - len(faults):
        faults.append(("faults", f"and {more} more"))
    return [
        ("flown by", one_line(f"{done.flown['estimator']}, {done.flown['law']}, seed {done.flown['seed']}")),
        ("flown", f"{world.links.agents} agents, {run.ticks} ticks of {run.dt:g} s"),
        ("network", f"availability {network.availability:g}{profile}"),
        *_errors(run),
        (
            "messages",
            f"{messages['offered']} offered, {messages['delivered']} delivered, {listed(dropped) or 'none lost'}",
        ),
        *faults,
        *(("jammed zone", str(jam)) for jam in done.zones),
        *(("why", one_line(reason)) for reason in done.reasons),
        ("digest", str(done.digest)),
    ]


def _errors(run: Evidence) -> list[tuple[str, str]]:
    done = run.outcome
    errors = {name.replace("_", " "): (of, "m") for name, of in done.errors.items()}
    if not errors and not run.plan.may_have_gaps:
        errors = {"tracking error": (done.tracking_error, "m²")}
    return [
        (
            name,
            ", ".join(f"{what} {'-' if value is None else f'{value:.4g}'}" for what, value in of.items()) + f" {unit}",
        )
        for name, (of, unit) in errors.items()
    ]
