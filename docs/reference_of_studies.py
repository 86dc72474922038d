"""The reference of studies: keys of a study file, what can be drawn and judged, and every shipped study with its claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from claims_page import PICTURES, group_of
from marked import Lines, code, filled, parameters, table, titled
from pydantic import BaseModel

from affinet.reference import catalogue
from affinet.reference.docstrings import first_line
from affinet.reference.entries import of_model
from affinet.studies import judging, quantities, record, study
from affinet.studies.study import Axis, Bound, Claim, Size, Study

_TABLES: Mapping[str, type[BaseModel]] = {"claims": Claim, "axes": Axis, "bound": Bound, "full, quick": Size}
_STANDS_FOR = {"mean": "mean", "root_mean_square": "root mean square", "maximum": "largest"}


def page() -> Lines:
    """Keys, figures, quantities, and studies."""
    yield from titled(
        "Studies",
        "Keys of a [study file](../studies.md#a-study-of-your-own), what can be drawn and judged, and the studies that come",
        "with affinet, with every claim that they judge.",
    )
    yield from ("", "## Keys of a study", "", *parameters(of_model(Study)))
    for name, model in _TABLES.items():
        yield from ("", f"### {name}", "", filled(first_line(model)), "", *parameters(of_model(model)))
    yield from (
        "",
        "## Figures",
        "",
        *table(("figure", "what"), ((code(one.name), one.says) for one in catalogue.figures())),
    )
    yield from (
        "",
        "## Quantities",
        "",
        "Each a number in every tick; over time a run has its mean, unless said otherwise.",
        "",
    )
    yield from table(("quantity", "what", "unit", "over time"), map(_quantity, quantities.NAMES))
    yield from ("", "## Studies that come with affinet")
    for name in study.shipped():
        yield from _of_study(name, study.load(name))


def _quantity(name: str) -> Sequence[str]:
    says, unit = quantities.said(name)
    return code(name), says, unit or "1", _STANDS_FOR[quantities.stands_for(name)]


def _of_study(name: str, read: Study) -> Lines:
    """A study: what it varies, draws and claims, with the verdicts of the full one, as far as it was flown."""
    yield from ("", f"### {name}", "", filled(f"{read.title} ({read.source})."), "")
    yield f"Scenario `{read.scenario}`, figure `{read.figure}`, {read.full.runs} runs of each case."
    yield from _links(name)
    yield from ("", *table(("axis", "labels"), ((one.name, ", ".join(one.values)) for one in read.axes)))
    full = record.full_study(name)
    verdicts = {} if full is None else {one.asked: str(one.decision) for one in full.claims}
    if read.claims:
        rows = (
            (one.says, code(one.check), code(one.quantity or read.quantity), _decided(read, one, verdicts))
            for one in read.claims
        )
        yield from ("", *table(("claim", "check", "quantity", "verdicts"), rows))


def _decided(read: Study, claim: Claim, verdicts: dict[str, str]) -> str:
    """How many of its cases come out in which way."""
    found = [verdicts.get(record.asked(read, one), "not flown in full yet") for one in judging.spelled_out(read, claim)]
    return ", ".join(f"{found.count(what)} {what}" if len(found) > 1 else what for what in dict.fromkeys(found))


def _links(name: str) -> Lines:
    yield f"`affinet study {name}` flies it."
    if (PICTURES / f"{name}.png").exists():
        yield f"Its [figure](../pictures/{name}.png)."
    if record.full_study(name):
        yield f"Its [means and verdicts](../claims/{group_of(name)}.md#{name})."
