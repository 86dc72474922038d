"""`affinet inject`: the air of a run is changed while it flies."""

from __future__ import annotations

import argparse

from affinet.cli import show
from affinet.runtimes.inject import Access, InjectRequest
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError


def inject(parsed: argparse.Namespace) -> None:
    """Change it, and say what is imposed then.

    Raises
    ------
    ScenarioError, NotFlying
        When there is no such run in flight, or it refuses.
    """
    request = InjectRequest(
        parsed.verb,
        links=tuple(getattr(parsed, "links", ())),
        groups=getattr(parsed, "groups", ()),
        loss=getattr(parsed, "loss", 0.0),
        lasts_s=getattr(parsed, "lasts", None),
        in_flight=getattr(parsed, "in_flight", "drop"),
    )
    flown = loading.resolved(parsed.directory)
    try:
        order = request.order(flown)
    except ValueError as error:
        raise ScenarioError(f"{parsed.verb}: {error}") from error
    answer = Access.to(parsed.directory).ask(order)
    if answer.refused:
        raise ScenarioError(f"{parsed.verb}: {answer.refused}")
    show.answer(answer, flown.time.dt)
