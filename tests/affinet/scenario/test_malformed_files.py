"""Files that are wrong in whatever way: exit status 2, and one line that says so; no traceback, and no end of waiting."""

from __future__ import annotations

import random
import re
import signal

import pytest

from affinet.cli.commands import main
from affinet.scenario import files
from affinet.studies import study

CASES, QUICK = 1000, 80
PATIENCE_S = 60  # for one file, on however busy a machine
TEXTS = {
    f"{folder}/{name}.toml": files.read(name, folder, "file").text
    for folder in ("scenarios", "studies")
    for name in files.shipped(folder)
}
EXTREMES = (
    "0", "-1", "1", "1e308", "-1e308", "1e-320", "inf", "-inf", "nan", "9" * 30, "9" * 5000, "0x" + "f" * 40, "1_000", "00",
    "true", '"1"', "[]", "{}", "1979-05-27", "''", "1.5", "[[[[]]]]", "0.1e-400",
)  # fmt: skip
JUNK = (
    "\x00",
    "é",
    "\u2028",
    "=",
    '"',
    "'''",
    "[",
    "]]",
    "{",
    "#",
    "\\",
    ".",
    ",",
    "🛩",
    "\r",
    "\x1b[31m",
    "-",
    "[[axes]]",
    "\ufeff",
)
WORDS = re.compile(r"[A-Za-z_][A-Za-z_-]+")
NUMBERS = re.compile(r"-?\d+(?:\.\d+)?")
STRINGS = re.compile(r'"[^"\n]*"')


def spoilt(draw: random.Random, text: str, pattern: re.Pattern[str], becomes) -> str:
    """The text with one of the places that match, if there is one, replaced."""
    found = [*pattern.finditer(text)]
    if not found:
        return text
    one = draw.choice(found)
    return text[: one.start()] + becomes(one.group()) + text[one.end() :]


def typo(draw, word):
    place = draw.randrange(len(word))
    return draw.choice(
        [word[:place] + word[place + 1 :], word[:place] + draw.choice("aeiou_-") + word[place:], word[::-1], word.upper()]
    )  # fmt: skip


def of_lines(change):
    def mutate(draw, text):
        lines = text.splitlines()
        change(draw, lines)
        return "\n".join(lines)

    return mutate


def swap(draw, lines):
    one, other = (draw.randrange(len(lines)) for _ in range(2))
    lines[one], lines[other] = lines[other], lines[one]


def insert(draw, text):
    place = draw.randrange(len(text) + 1)
    return text[:place] + draw.choice(JUNK) + text[place:]


MUTATIONS = {
    "delete a line": of_lines(lambda draw, lines: lines.pop(draw.randrange(len(lines)))),
    "repeat a line": of_lines(lambda draw, lines: lines.insert(draw.randrange(len(lines)), draw.choice(lines))),
    "swap lines": of_lines(swap),
    "truncate": lambda draw, text: text[: draw.randrange(len(text))],
    "insert junk": insert,
    "an extreme for a number": lambda draw, text: spoilt(draw, text, NUMBERS, lambda _: draw.choice(EXTREMES)),
    "a typo": lambda draw, text: spoilt(draw, text, WORDS, lambda word: typo(draw, word)),
    "another word": lambda draw, text: spoilt(draw, text, WORDS, lambda _: draw.choice(WORDS.findall(text))),
    "an extreme for a text": lambda draw, text: spoilt(draw, text, STRINGS, lambda _: draw.choice(EXTREMES)),
    "another text": lambda draw, text: spoilt(draw, text, STRINGS, lambda _: draw.choice(STRINGS.findall(text))),
    "an odd text": lambda draw, text: spoilt(draw, text, STRINGS, lambda s: f'"{s[1:-1]}{draw.choice(JUNK[1:])}"'),
    "nest": lambda draw, text: spoilt(draw, text, STRINGS, lambda s: "[" * 2 ** draw.randrange(14) + s),
    "a list of it": lambda draw, text: spoilt(draw, text, NUMBERS, lambda number: f"[{number}]"),
    "a table of it": lambda draw, text: spoilt(draw, text, STRINGS, lambda s: f"{{ a = {s} }}"),
}


def malformed(number: int) -> tuple[str, str]:
    """A case: what is done to which file, and the text that it makes."""
    draw = random.Random(number)
    file = draw.choice(sorted(TEXTS))
    text, names = TEXTS[file], []
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        names.append(draw.choice(sorted(MUTATIONS)))
        text = MUTATIONS[names[-1]](draw, text or " ")
    return f"{number}: {file}: {', '.join(names)}", text


class Flies(Exception):
    """A study that all is right with."""


def flies(*_, **__):
    raise Flies


def too_long(*_):
    raise TimeoutError(f"not read in {PATIENCE_S} s")


def judged(number, tmp_path, capsys):
    """The exit status of a case, and what is wrong with how it is told; nothing is flown."""
    case, text = malformed(number)
    folder = "study" if "studies/" in case else "scenario"
    path = tmp_path / f"{folder}.toml"
    path.write_text(text, encoding="utf-8", newline="")
    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(PATIENCE_S)
    try:
        status = main(
            ["check", str(path)] if folder == "scenario" else ["study", str(path), "--quick", "--out", str(tmp_path)]
        )
    except Flies:
        status = 0
    except BaseException as error:  # noqa: BLE001 - whatever comes out is what this looks for
        return None, f"{case}: {type(error).__name__}: {error}"
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    told = capsys.readouterr()
    lines = told.err.strip().splitlines()  # a progress bar may leave an empty line
    if "Traceback" in told.err or "Warning" in told.err:
        return status, f"{case}: {told.err}"
    if (status, len(lines)) not in ((0, 0), (2, 1)):
        return status, f"{case}: exit status {status} and {len(lines)} lines: {lines[:3]}"
    if lines and (len(lines[0]) > 1200 or path.name not in lines[0]):
        return status, f"{case}: {lines[0]}"
    return status, None


def count(numbers, tmp_path, capsys):
    found = [judged(number, tmp_path, capsys) for number in numbers]
    wrong = [says for _, says in found if says]
    assert not wrong, "\n".join(wrong)
    refused = sum(status == 2 for status, _ in found)
    assert 0.4 * len(found) < refused < len(found)  # most say something else than a scenario, and some still do


def test_malformed_files_are_refused_in_one_line_each(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study, "plans", flies)  # hundreds of cases take long to plan
    count(range(QUICK), tmp_path, capsys)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_thousand_malformed_files_are_refused_in_one_line_each(tmp_path, capsys, monkeypatch):
    known, planned = {}, study._planned

    def remembered(of, case):
        key = (of.scenario, case.overrides)
        if key not in known:
            known[key] = planned(of, case)
        return known[key]

    monkeypatch.setattr(study, "_planned", remembered)
    monkeypatch.setattr(study, "fly", flies)
    count(range(CASES), tmp_path, capsys)
