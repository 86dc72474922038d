"""What `affinet conformance` finds: nothing of agents that conform, and of others what is wrong with them and no more."""

import json
import re
import sys

import pytest
from flying import PROCESSES
from paths import DOCS, PROGRAMS

from affinet.cli import commands
from affinet.conformance.flying import Patience
from affinet.conformance.suite import CASES, findings

pytestmark = PROCESSES

OURS = [sys.executable, "-c", "from agents.process import main; main()"]
EXAMPLE = [sys.executable, str(DOCS / "examples" / "agent.py")]
BRISK = Patience(ready_s=2.0, answer_s=0.6)

# What a planted fault has to show, and nothing else. Who speaks before it is asked has its first answer doubled by that, and so on.
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


@pytest.mark.parametrize("wrong", PLANTED)
def test_a_planted_fault_shows_where_it_should(wrong):
    assert failing(deviant(wrong), of_flights_that_show(wrong)).keys() == PLANTED[wrong]


@pytest.mark.slow
@pytest.mark.parametrize("wrong", PLANTED)
def test_a_planted_fault_shows_nowhere_else(wrong):
    assert failing(deviant(wrong)).keys() == PLANTED[wrong]


def test_every_case_has_a_fault_that_it_finds():
    assert {case.name for case in CASES} == set().union(*PLANTED.values())
    assert len({case.name for case in CASES}) == len(CASES)
