"""What hunts leave for the next: a folder of trials that broke something, or covered what none before had; a file each."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from hashlib import blake2b
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from affinet.scenario.words import one_line
from affinet.scenario.wrong import ScenarioError
from affinet.testing.trial import Trial
from netem.processes.system_errors import about

_ENDINGS = {"kill": "restart"}
_LETTERS = 12  # of a digest, in the name of a file


class Kept(BaseModel):
    """A file of a corpus."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    scenario: str
    settings: list[str]
    seed: Annotated[int, Field(ge=0, lt=2**64)]
    faults: Annotated[list[list[dict[str, Any]]], Field(min_length=1)]
    breaks: list[str]

    @field_validator("faults")
    @classmethod
    def _each_is_one(cls, faults: list[list[dict[str, Any]]]) -> list[list[dict[str, Any]]]:
        for fault in faults:
            verbs = [entry.get("verb") for entry in fault]
            ends = len(fault) == 2 and _ENDINGS.get(str(verbs[0])) == verbs[1] and "at" in fault[1]
            if not verbs or None in verbs or not (len(fault) == 1 or ends):
                raise ValueError("a fault is one entry with its verb, or a kill and the restart that ends it")
        return faults


class Found(NamedTuple):
    """A trial of a corpus, and where it stands."""

    file: Path
    trial: Trial


def read(folder: Path) -> list[Found]:
    """The trials of a folder, by the names of their files; those of none, if it is not there yet.

    Raises
    ------
    ScenarioError
        When a file in it is none of a corpus.
    OSError
        When one cannot be read.
    """
    if folder.exists() and not folder.is_dir():
        raise ScenarioError(f"--corpus {folder}: it is a file; name a folder")
    return [Found(file, _trial(file)) for file in sorted(folder.glob("*.json"))]


def keep(folder: Path, scenario: str, worth: Iterable[tuple[Trial, Sequence[str]]]) -> int:
    """Leave trials in a folder, with what each breaks, unless they are there; how many are new.

    Raises
    ------
    OSError
        When one cannot be written.
    """
    with about(folder):
        folder.mkdir(parents=True, exist_ok=True)
    new = 0
    for trial, breaks in worth:
        digest = blake2b(trial.key.encode()).hexdigest()[:_LETTERS]
        file = folder / f"{'breaks' if breaks else 'covers'}-{digest}.json"
        said = Kept(
            scenario=scenario,
            settings=list(trial.settings),
            seed=trial.seed,
            faults=[list(fault) for fault in trial.faults],
            breaks=list(breaks),
        )
        if not file.exists():
            with about(file):
                file.write_text(json.dumps(said.model_dump(), indent=1) + "\n", encoding="utf-8")
            new += 1
    return new


def _trial(file: Path) -> Trial:
    try:
        with about(file):
            said = Kept.model_validate_json(file.read_text(encoding="utf-8"))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])) or "it"
        raise ScenarioError(
            f"{file}: {key}: {one_line(first['msg'])}; a hunt with --corpus writes such files: remove it, or put it right"
        ) from None
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{file}: {error}; a hunt with --corpus writes such files: remove it") from error
    return Trial(tuple(said.settings), said.seed, tuple(said.faults))
