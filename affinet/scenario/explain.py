"""What is wrong in a file, in one line: where, which key, what was given, and what would be right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from affinet.scenario import forms
from affinet.scenario.forms import Place
from affinet.scenario.source import Source
from affinet.scenario.words import hint, one_line, shown

_MOST_NAMED = 3

# What is wrong with a value of the right type: pydantic's words for it are those of people.
_BOUNDS = {
    "greater_than",
    "greater_than_equal",
    "less_than",
    "less_than_equal",
    "finite_number",
    "multiple_of",
}


@dataclass(frozen=True)
class Mistake:
    """One thing that is wrong.

    Parameters
    ----------
    key
        Where, as people write it.
    says
        What, and what would be right.
    alike
        What two of them share that are the same mistake, made in several elements of a list.
    rank
        Unknown keys come first: what is missing is often what was meant.
    meant
        The key that an unknown one may stand for.
    """

    key: str
    says: str
    alike: tuple[str, str]
    rank: int
    meant: str | None = None


def explained(error: ValidationError, model: type[BaseModel], source: Source) -> str:
    """All that is wrong, in one line: the first mistake in full, and the keys of the others.

    Parameters
    ----------
    error
        What pydantic found.
    model
        What it should be.
    source
        Where it was said.
    """
    first, *others = mistakes(error, model)
    more = [other for other in others if other.alike != first.alike]
    says = f"{source.place(first.key)}: {one_line(first.key) or 'the file'}: {first.says}"
    if again := len(others) - len(more):
        says += f" ({again} more like it in {first.alike[0]})"
    apart = list({other.alike: other for other in reversed(more)}.values())[::-1]
    return says + _also(source, [one.key for one in apart])


def named_in(source: Source, wrong: Sequence[tuple[str, str]]) -> str:
    """What is wrong, by key, in one line: the first in full, and the keys of the others."""
    key, says = wrong[0]
    others = dict.fromkeys(other for other, _ in wrong if other != key)
    return f"{source.place(key)}: {key}: {says}{_also(source, list(others))}"


def _also(source: Source, keys: Sequence[str]) -> str:
    if not keys:
        return ""
    named = ", ".join(f"{one_line(key) or 'the file'} ({source.place(key)})" for key in keys[:_MOST_NAMED])
    etc = ", ..." if len(keys) > _MOST_NAMED else ""
    return f"; at least {len(keys)} more mistake{'s' * (len(keys) > 1)}: {named}{etc}"


def mistakes(error: ValidationError, model: type[BaseModel]) -> list[Mistake]:
    """What is wrong, unknown keys first; what is missing because it was misspelt is no mistake of its own."""
    found = [_mistake(model, problem) for problem in _without_other_members(error, model)]
    meant = {one.meant for one in found}
    return sorted((one for one in found if one.rank < 2 or one.key not in meant), key=lambda one: one.rank)


def wrong(problem: Mapping[str, Any], model: type[BaseModel]) -> str:
    """What is wrong with a value, by one of pydantic's problems, and what would be right."""
    return _mistake(model, problem).says


def _mistake(model: type[BaseModel], problem: Mapping[str, Any]) -> Mistake:
    loc, code = problem["loc"], problem["type"]
    where = forms.place(model, loc)
    if code == "extra_forbidden":
        table = forms.place(model, loc[:-1])
        known = sorted(forms.bare(table.kind).model_fields)
        near = _within(loc, model) or hint(loc[-1], known) or _called(loc[-1], known)
        meant = ".".join(filter(None, (table.key, near.split("'")[1]))) if near else None
        above = f"{loc[-1]!r} is a key of the file itself; " if not near and loc[-1] in model.model_fields else ""
        says = f"unknown key; {near}{above}known here: {', '.join(known)}"
        return Mistake(where.key, says, (table.path or "the file", where.key), 0, meant)
    return Mistake(where.key, _says(where, problem), (where.path or "the file", code), 2 if code == "missing" else 1)


# What a probability of losing a message is called elsewhere.
_SAME = ({"p", "loss", "probability"},)


def _called(word: object, known: Sequence[str]) -> str:
    """The question whether another word for the same is meant."""
    others = next((names - {word} for names in _SAME if word in names), set())
    return next((f"did you mean {name!r}? " for name in known if name in others), "")


def _within(loc: Sequence[str | int], model: type[BaseModel]) -> str:
    """The question whether the key of that name in a table is meant, of one that stands in the file itself."""
    if len(loc) > 1:
        return ""
    tables = ((name, forms.bare(field.annotation)) for name, field in model.model_fields.items())
    inner = (
        f"{name}.{loc[0]}"
        for name, kind in tables
        if isinstance(kind, type) and issubclass(kind, BaseModel) and loc[0] in kind.model_fields
    )
    return next((f"did you mean {key!r}? " for key in inner), "")


def _says(where: Place, problem: Mapping[str, Any]) -> str:
    given, code, context = problem["input"], problem["type"], problem.get("ctx", {})
    match code:
        case "missing":
            return f"is missing; it has no default: give {forms.form(where.kind, where.path)}"
        case "union_tag_not_found" | "union_tag_invalid":
            tag = context["discriminator"].strip("'")
            known, word = forms.tags(where.kind, tag), given.get(tag, "")
            got = f", got {shown(word)}; {hint(word, known)}".rstrip("; ") if tag in given else ""
            return f"needs a {tag} among {', '.join(known)}{got}"
        case "value_error":
            return one_line(str(context["error"]))
        case "literal_error":
            near = hint(given, [str(one) for one in get_args(forms.bare(where.kind))])
            return f"should be {context['expected']}, got {shown(given)}" + (f"; {near}".rstrip() if near else "")
        case "too_short" | "too_long":
            least, most = context.get("min_length"), context.get("max_length")
            number = f"at least {least}" if code == "too_short" else f"at most {most}"
            items = "item" if 1 in (least, most) else "items"
            return (
                f"should have {number} {items}, like {shown(forms.example(where.kind, where.path))}, got {shown(given)}"
            )
    if code in _BOUNDS:
        return f"{problem['msg'].replace('Input should', 'should')}, got {shown(given)}"
    plain = {int, float, bool}.issuperset(forms.choices(where.kind))
    unquoted = ", without quotes" if plain and _is_no_text(given) else ""
    share = _share(given) if float in forms.choices(where.kind) else ""
    return f"should be {forms.form(where.kind, where.path)}{unquoted}, got {shown(given)}{share}"


def _share(given: object) -> str:
    """What a percentage is as a number."""
    if not isinstance(given, str) or not given.strip().endswith("%"):
        return ""
    try:
        return f"; write {float(given.strip()[:-1]) / 100.0:.10g}"
    except ValueError:
        return ""


def _is_no_text(given: object) -> bool:
    if not isinstance(given, str):
        return False
    try:
        float(given)
    except ValueError:
        return given in ("true", "false")
    return True


def _without_other_members(error: ValidationError, model: type[BaseModel]) -> list[Mapping[str, Any]]:
    """The problems; of a value that fits none of several types, only what is wrong as the one that it comes nearest to."""
    found: dict[tuple[str | int, ...], Mapping[str, Any]] = {}
    for problem in error.errors(include_url=False):
        depth = forms.union(model, problem["loc"])
        place = problem["loc"] if depth is None else problem["loc"][:depth]
        if depth is not None and len(problem["loc"]) == depth + 1:
            found.setdefault(place, {**problem, "loc": place, "type": "none_of_them"})
        elif depth is None or found.get(place, {"type": "none_of_them"})["type"] == "none_of_them":
            found[place] = problem
    return list(found.values())
