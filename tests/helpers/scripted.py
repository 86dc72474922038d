"""Timelines as overrides of a scenario."""

import json


def timeline(*entries):
    """The override that makes these entries, as dictionaries, the timeline of a scenario."""
    return f"timeline={toml(list(entries))}"


def toml(value):
    """A value as it stands in a TOML file."""
    match value:
        case dict():
            return "{" + ", ".join(f"{json.dumps(name)} = {toml(each)}" for name, each in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)
