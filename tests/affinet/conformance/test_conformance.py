"""What `affinet conformance` finds: nothing of agents that conform, and of others what is wrong with them and no more."""

import json
import re
import shlex
import shutil
import sys
from functools import partial

import pytest
from flying import PROCESSES
from paths import DOCS, PROGRAMS

from affinet.cli import commands, conforming, status
from affinet.conformance import flights
from affinet.conformance.air import Air
from affinet.conformance.flying import Patience
from affinet.conformance.suite import CASES, findings
from netem.wire import messages

pytestmark = PROCESSES

OURS = [sys.executable, "-c", "from agents.process import main; main()"]
BRISK = Patience(ready_s=6.0, answer_s=1.5)

# What a planted fault has to show, and nothing else.
PLANTED = {
    "is never ready": {"ready"},
    "deaf": {"ready"},
    "speaks at once": {"unasked", "once"},
    "prints": {"lines"},
    "does not say that it is done": {"done", "end-first"},
    "stays": {"done", "exit", "end-first"},
    "leaves with an error": {"exit", "end-first"},
    "ignores its lifeline": {"orphaned", "orphaned-early"},
    "forgets a channel": {"channels"},
    "is mute": {"channels"},
    "does not act": {"acts"},
    "speaks twice": {"once"},
    "speaks on a channel of its own": {"once"},
    "tells an old tick": {"tick"},
    "speaks as another": {"source"},
    "skips a number": {"numbers"},
    "broadcasts another shape": {"broadcast-forms"},
    "believes of too many": {"act-forms"},
    "diverges": {"act-forms"},
    "miscounts": {"heard"},
    "tells an old input": {"input", "pause-input"},
    "goes too fast": {"limit"},
    "dies of silence": {"silence"},
    "counts no late ones": {"late"},
    "counts no doubles": {"doubled"},
    "takes the time from its clock": {"clock"},
    "keeps its numbers": {"restart-numbers", "restart-warm"},
    "keeps its count": {"restart-heard"},
    "keeps its input": {"restart-input"},
    "cannot remember": {"restart-warm"},
    "begins anew after a pause": {"pause-numbers"},
    "forgets its input in a pause": {"pause-input"},
    "leaves garbage aside": {"garbage", "no-phase"},
    "leaves garbage in peace": {"garbage", "no-phase"},
    "overlooks gaps": {"gap"},
    "knows few": {"large"},
    "flat": {"space"},
    "is no leader": {"leader"},
    "knows one integrator": {"double"},
}


def deviant(wrong):
    return [sys.executable, str(PROGRAMS / "deviant_agent.py"), wrong]


def failing(command, cases=CASES, estimator="none"):
    return {
        finding.case.name: finding
        for finding in findings(command, estimator, BRISK, cases)
        if finding.verdict == "fail"
    }


def of_flights_that_show(wrong):
    shown_by = {case.flight for case in CASES if case.name in PLANTED[wrong]}
    return [case for case in CASES if case.flight in shown_by]


OFTEN_MET = [
    "is never ready",
    "speaks at once",
    "prints",
    "stays",
    "ignores its lifeline",
    "forgets a channel",
    "speaks twice",
    "tells an old tick",
    "skips a number",
    "broadcasts another shape",
    "tells an old input",
    "keeps its numbers",
    "overlooks gaps",
]


@pytest.mark.parametrize("wrong", OFTEN_MET)
def test_a_planted_fault_shows_where_it_should(wrong):
    assert failing(deviant(wrong), of_flights_that_show(wrong)).keys() == PLANTED[wrong]


@pytest.mark.slow
@pytest.mark.parametrize("wrong", PLANTED)
def test_a_planted_fault_shows_nowhere_else(wrong):
    assert failing(deviant(wrong)).keys() == PLANTED[wrong]


def test_every_case_has_a_fault_that_it_finds():
    assert {case.name for case in CASES} == set().union(*PLANTED.values())
    assert len({case.name for case in CASES}) == len(CASES)


EXAMPLES = [
    pytest.param([sys.executable, str(DOCS / "examples" / "agent.py")], id="python"),
    pytest.param(
        ["node", str(DOCS / "examples" / "node" / "agent.mjs")],
        id="node",
        marks=pytest.mark.skipif(shutil.which("node") is None, reason="there is no node on the path"),
    ),
]


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_of_the_docs_hears_what_comes_in_fragments(example, monkeypatch):
    long = messages.pack(messages.Broadcast(k=0, src=2, channel="input", seq=0, payload={"velocity": bytes(100_000)}))
    monkeypatch.setattr(Air, "said", lambda *_: long)
    cases = [case for case in CASES if case.name in ("acts", "heard")]
    assert [finding.verdict for finding in findings(example, "none", Patience(), cases)] == ["pass", "pass"]


@pytest.mark.slow
def test_our_own_agent_conforms():
    verdicts = {finding.case.name: finding.verdict for finding in findings(OURS, "ga-rkf", Patience())}
    assert set(verdicts.values()) == {"pass"}, verdicts


def test_what_an_estimator_cannot_fly_is_not_asked_of_its_agent():
    cases = [case for case in CASES if case.name in ("restart-numbers", "clock")]
    verdicts = {
        finding.case.name: (finding.verdict, finding.instead) for finding in findings(OURS, "crkf", Patience(), cases)
    }
    assert verdicts["clock"] == ("pass", ())
    verdict, (why,) = verdicts["restart-numbers"]
    assert verdict == "not applicable"
    assert why.startswith("crkf cannot fly it: ")


def test_an_agent_that_steers_nowhere_keeps_no_limit():
    (limit,) = (case for case in CASES if case.name == "limit")
    (finding,) = findings(deviant("holds still"), "none", BRISK, [limit])
    assert (finding.verdict, finding.instead) == ("not applicable", ("it steered nowhere",))


def test_a_flight_that_breaks_off_shows_nothing_of_what_was_to_come():
    cases = [case for case in CASES if case.name in ("ready", "tick", "done", "acts")]
    found = {finding.case.name: finding for finding in findings(deviant("is mute"), "none", BRISK, cases)}
    assert {name: finding.verdict for name, finding in found.items()} == {
        "ready": "pass",
        "tick": "not reached",
        "done": "not reached",
        "acts": "not reached",
    }
    # On a busy machine it may not have come to sleep yet.
    mute = r"tick 6, sense: nothing came on input, measurement, and it (sleeps|computes) \(state \w\)"
    assert re.match(mute, found["tick"].instead[0])


def test_the_end_of_a_log_is_told_of_who_dies():
    cases = [case for case in CASES if case.name == "silence"]
    (finding,) = findings(deviant("dies of silence"), "none", BRISK, cases)
    assert "ended with exit status 1. Its last lines:\n    nothing measured" in finding.instead[0]


def test_of_an_agent_that_never_comes_no_further_flight_is_flown():
    found = list(findings(deviant("is never ready"), "none", BRISK))
    assert [finding.case.name for finding in found] == sorted([case.name for case in CASES], key=of_flights())
    assert {finding.verdict for finding in found if finding.case.name != "ready"} == {"not reached"}


def of_flights():
    in_order = [*dict.fromkeys(case.flight for case in CASES)]
    return lambda name: next(in_order.index(case.flight) for case in CASES if case.name == name)


def test_the_command_says_what_was_found_and_writes_it_down(tmp_path, capsys, monkeypatch):
    some = [case for case in CASES if case.flight in (flights.PLAIN, flights.UNASKED)]
    monkeypatch.setattr(conforming, "findings", partial(findings, cases=some))
    report = tmp_path / "report.json"
    ended = commands.main(["conformance", shlex.join(deviant("leaves with an error")), "--out", str(report)])
    assert ended == status.FAIL
    said = capsys.readouterr().out
    assert f"{len(some) - 2} pass, 2 fail" in said
    assert "exit: it has to leave then, with exit status 0\n    agent 5 (pid " in said
    told = json.loads(report.read_text())
    assert (told["estimator"], told["conforms"]) == ("none", False)
    (case,) = (case for case in told["cases"] if case["case"] == "exit")
    assert (case["verdict"], case["section"], case["flight"]) == ("fail", "An agent's life, 5. End", "plain")
    assert "ended with exit status 3" in case["instead"][0]


def test_a_command_that_starts_nothing_is_bad_input(capsys):
    assert commands.main(["conformance", "no-such-program"]) == status.BAD_INPUT
    assert "no-such-program" in capsys.readouterr().err
    assert commands.main(["conformance", "true", "--estimator", "nonsense"]) == status.BAD_INPUT
    assert "agents.estimator" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["", "python 'agent.py"])
def test_a_command_line_is_one(command, capsys):
    with pytest.raises(SystemExit, match="2"):
        commands.main(["conformance", command])
    assert "COMMAND: " in capsys.readouterr().err


PROTOCOL = (DOCS / "protocol.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("section", sorted({case.section for case in CASES}))
def test_a_case_names_a_section_that_there_is(section):
    title, _, step = section.partition(", ") if section.startswith("An agent's life") else (section, "", "")
    (text,) = re.findall(rf"^## {title}$(.*?)(?=^## |\Z)", PROTOCOL, flags=re.MULTILINE | re.DOTALL)
    number, _, word = step.partition(". ")
    assert re.search(rf"^{number}\. \*\*{word}\b", text, flags=re.MULTILINE) if step else text.strip()
