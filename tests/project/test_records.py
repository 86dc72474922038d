"""Every shipped study has a record, and it is the study's, and agrees with itself. Whoever edits one is found out."""

import re
from collections import Counter, defaultdict
from functools import cache

import claims_page
import pytest
from held_records import NOT_TOLD, faults, verdicts, wrong_verdict
from paper_claims import paper_claims
from read_verdicts import Runs, read

from affinet.studies import record, study
from affinet.studies.study import Claim
from analysis.claims.intervals import Decision

FOUR = study.load("paper-001-fig4")
FULL = record.full_study("paper-001-fig4")


def test_every_study_has_a_record_and_every_record_a_study():
    assert {file.stem for file in claims_page.RESULTS.glob("*")} == set(study.shipped())


@pytest.mark.parametrize("name", study.shipped())
def test_a_record_is_that_of_its_study_and_agrees_with_itself(name):
    assert [*faults(study.load(name), record.full_study(name))] == [], f"fly {name} again, or take its record away"


@cache
def all_verdicts():
    """Of all records: record, claim, what was judged, and what is known of the runs."""
    records = [(study.load(name), record.full_study(name)) for name in study.shipped()]
    return [(full, *each) for of, full in records for each in verdicts(of, full)]


def unnoticed(edit):
    """Every verdict that an edit changes, and those of them of which that is not found out."""
    edited = [(full, claim, judged, edit(judged), runs) for full, claim, judged, runs in all_verdicts()]
    edited = [each for each in edited if each[2] != each[3]]
    return edited, [new.found for full, claim, _, new, runs in edited if not [*wrong_verdict(full, claim, new, runs)]]


@pytest.mark.parametrize("decision", Decision)
def test_no_verdict_of_any_record_can_be_turned_unnoticed(decision):
    edited, missed = unnoticed(lambda judged: judged.model_copy(update={"decision": decision}))
    assert len(edited) > 100
    assert missed == []


# What reads, what is written in its place, and in how many verdicts at least that is an edit.
TEXTS = {
    "other shares of all": (r"\d+% to \d+% of all", "12% to 99% of all", 198),
    "other runs": (r"^(\d+) of \d+ runs", r"\1 of 4000 runs", 198),
    "another share asked": ("asked 90%", "asked 50%", 198),
    "wider bounds": (r"asked (\S+) to (\S+)", r"asked \1 to \g<2>9", 169),
    "a larger factor": (r"allowed \S+:", "allowed 9:", 8),
    "a lower correlation": (r"asked 0\.9$", "asked 0.8", 2),
    "a square of a length": (r" m(?=$|[,; ])", " m²", 204),
    "a length of a square": (" m²", " m", 183),
    "another level": (r"(below|above) (\S+)", r"\1 \g<2>1", 185),
    "another mean": (r": [\d.]+, ", ": 77, ", 8),
    "a mean of the other's": (r"in the mean (\S+) against (\S+)", r"in the mean \2 against \1", 1),
    "above where it is below": (r"closest \S+", "closest 9", 2),
    "the other direction": (r"^lower by (?=\d)", "lower by -", 100),
    "found out of its interval": (r"^(lower by|ratio|) ?(\d\S*) \(", r"\1 9\2 (", 300),
    "more cases": (r"^(lower by) (\S+ \(\S+ to \S+\))", r"\1 \2, \2", 100),
    "draws in common": (r" \(the runs compared.*\)$", "", 51),
    "draws of their own": (r"^(lower by .*[m²])$", r"\1 (the runs compared do not meet the same draws)", 100),
    "something in front": ("^", "nearly ", 564),
    "something behind": ("$", " or so", 564),
}


@pytest.mark.parametrize(("reads", "written", "least"), TEXTS.values(), ids=TEXTS)
def test_no_text_of_any_record_can_be_edited_unnoticed(reads, written, least):
    edited, missed = unnoticed(
        lambda judged: judged.model_copy(update={"found": re.sub(reads, written, judged.found, count=1)})
    )
    assert len(edited) >= least
    assert missed == []


def test_what_the_text_does_not_tell_is_listed_and_nothing_else():
    open_still = {
        (full.source, judged.says)
        for full, claim, judged, runs in all_verdicts()
        if len(read(claim, judged.found, runs).decisions) > 1
    }
    assert open_still == set(NOT_TOLD)


def claims(change):
    return FULL.model_copy(update={"claims": change([*FULL.claims])})


def first_claim(**new):
    return claims(lambda every: [every[0].model_copy(update=new), *every[1:]])


def first_case(**new):
    return FULL.model_copy(update={"cases": [FULL.cases[0].model_copy(update=new), *FULL.cases[1:]]})


def asked_swapped(every):
    one, other = every[1], every[2]
    return [
        every[0],
        one.model_copy(update={"asked": other.asked}),
        other.model_copy(update={"asked": one.asked}),
        *every[3:],
    ]


FAILED = FULL.claims[0].model_copy(update={"decision": Decision.DOES_NOT_HOLD})
EDITS = {
    "says something else": first_claim(says="steady covariance trace: JRKF far above RKF"),
    "decides against what was found": first_claim(decision=Decision.DOES_NOT_HOLD),
    "found against the decision": first_claim(found="higher by 0.000438 (0.000438 to 0.000438) m²"),
    "found in another unit": first_claim(found="lower by 0.000438 (0.000438 to 0.000438) m"),
    "found what nobody reads": first_claim(found="lower by far"),
    "found an interval that is none": first_claim(found="lower by 0.5 (0.000438 to 0.000439) m²"),
    "asks what another does": claims(asked_swapped),
    "a second verdict before": claims(lambda every: [FAILED, *every]),
    "a second verdict after": claims(lambda every: [*every, FAILED]),
    "another order": claims(lambda every: every[::-1]),
    "a verdict less": claims(lambda every: every[:-1]),
    "another title": FULL.model_copy(update={"title": "Five estimators"}),
    "another source": FULL.model_copy(update={"source": "paper 002"}),
    "another confidence": FULL.model_copy(update={"confidence": 0.5}),
    "quick": FULL.model_copy(update={"quick": True}),
    "more runs": FULL.model_copy(update={"runs": 500}),
    "another grid": FULL.model_copy(update={"flown": "0" * 16}),
    "a mean outside its interval": first_case(found=99.0),
    "a mean that is a little larger": first_case(found=FULL.cases[0].found * 1.0001),
    "the other half of an interval": first_case(high=None),
    "an interval that is turned round": first_case(low=FULL.cases[0].high, high=FULL.cases[0].low),
    "an interval of nothing": first_case(found=None),
    "half an interval": first_case(low=None),
    "another unit": first_case(unit="furlong"),
    "another quantity": first_case(quantity="nees"),
    "means of each other": first_case(labels=FULL.cases[-1].labels),
    "a mean twice": FULL.model_copy(update={"cases": [FULL.cases[0], *FULL.cases]}),
    "a mean less": FULL.model_copy(update={"cases": FULL.cases[1:]}),
}


@pytest.mark.parametrize("edited", EDITS.values(), ids=EDITS)
def test_an_edit_of_a_record_is_found(edited):
    assert [*faults(FOUR, edited)] != []


STUDIES = {
    "another title": {"title": "Five estimators"},
    "another source": {"source": "paper 002"},
    "another quantity": {"quantity": "error"},
    "another span of a claim": {"claims": [FOUR.claims[0].model_copy(update={"since": 0.0}), *FOUR.claims[1:]]},
    "said the other way round": {
        "claims": [FOUR.claims[0].model_copy(update={"says": "JRKF far above RKF"}), *FOUR.claims[1:]]
    },
    "more runs": {"full": FOUR.full.model_copy(update={"runs": 51})},
    "its opposite": {
        "claims": [
            FOUR.claims[0].model_copy(update={"of": FOUR.claims[0].to, "to": FOUR.claims[0].of}),
            *FOUR.claims[1:],
        ]
    },
}


@pytest.mark.parametrize("new", STUDIES.values(), ids=STUDIES)
def test_an_edit_of_a_study_is_found(new):
    assert [*faults(FOUR.model_copy(update=new), FULL)] != []


CLAIMS = {
    "lower": Claim(says="", check="lower", to={}),
    "ratio": Claim(says="", check="ratio", to={}, between=[0.95, 1.05]),
    "value": Claim(says="", check="value", level=1.0, between=[-1000.0, -0.1]),
    "stays_below": Claim(says="", check="stays_below", level=0.2),
    "slower_with_anchor": Claim(says="", check="slower_with_anchor"),
    "indicator_below_error": Claim(says="", check="indicator_below_error"),
    "indicator_follows_error": Claim(says="", check="indicator_follows_error"),
    "flat": Claim(says="", check="flat", level=2.0),
}
YES, NO, OPEN = Decision.HOLDS, Decision.DOES_NOT_HOLD, Decision.UNDECIDED


def told(check, found, cases=1):
    return read(CLAIMS[check], found, Runs(number=50, cases=cases, unit="m", paired=True, means=None, others=None))


@pytest.mark.parametrize(
    ("check", "found", "follows"),
    [
        ("ratio", "ratio 0.15 (0.14 to 0.16), asked 0.95 to 1.05", {NO}),
        ("ratio", "ratio 1 (0.9 to 1.1), asked 0.95 to 1.05", {OPEN}),
        ("ratio", "ratio 1 (0.99 to 1.01), asked 0.95 to 1.05", {YES}),
        ("ratio", "ratio 1 (0.95 to 1.01), asked 0.95 to 1.05", {YES, OPEN}),
        ("ratio", "ratio nan (-inf to inf), asked 0.95 to 1.05", {OPEN}),
        ("value", "0.213 (0.14 to 0.287) m, asked -1e+03 to -0.1", {NO}),
        ("value", "-0.676 (-0.838 to -0.515) m, asked -1e+03 to -0.1", {YES}),
        ("lower", "lower by 0 (0 to 0) m", {NO}),
        ("lower", "lower by 2 (1 to 3) m", {YES}),
        ("lower", "lower by 2 (-1 to 5) m", {OPEN}),
        ("lower", "higher by 2 (-1 to 5) m", {OPEN}),
        ("lower", "higher by 2 (1 to 3) m", {NO}),
        ("stays_below", "44 of 50 runs stay below 0.2 m; 73% to 96% of all, asked 90% at least", {OPEN}),
        ("stays_below", "50 of 50 runs stay below 0.2 m; 91% to 100% of all, asked 90% at least", {YES}),
        ("stays_below", "0 of 50 runs stay below 0.2 m; 0% to 9% of all, asked 90% at least", {NO}),
        ("indicator_below_error", "at 599 of 600 moments, for all 4; closest 0.1", {OPEN}),
        ("indicator_below_error", "above at 1.2% of the moments, first at 3 s by 0.1", {NO}),
        ("indicator_follows_error", "least rank correlation 0.887 (0.855 to 0.919), asked 0.9", {OPEN}),
        ("slower_with_anchor", "19 of 20 are not above; in the mean 1 against 2", {NO}),
        ("slower_with_anchor", "19 of 20 are not above, of 1 it cannot be told; in the mean 1 against 2", {OPEN}),
    ],
)
def test_what_follows_from_what_was_found(check, found, follows):
    read_so = told(check, found)
    assert (read_so.decisions, read_so.wrong) == (follows, [])


def test_the_largest_of_ratios_decides_whether_cases_are_alike():
    assert told("flat", "largest over smallest 3 (2.9 to 3.1), allowed 2: 3, 1 m", cases=2).decisions == {NO}


@pytest.mark.parametrize(
    ("check", "found"),
    [
        ("lower", "lower by 1.1 (1 to 3) m"),  # Student's interval has it in the middle
        ("lower", "higher by -2 (-3 to -1) m"),
        ("value", "0.15 (0.14 to 0.287) m, asked -1e+03 to -0.1"),
        ("ratio", "ratio 2 (0.9 to 1.1), asked 0.95 to 1.05"),
        ("stays_below", "44 of 50 runs stay below 0.2 m; 83% to 96% of all, asked 90% at least"),
    ],
)
def test_what_contradicts_itself_is_seen(check, found):
    assert told(check, found).wrong != []


@pytest.mark.parametrize(
    ("check", "found"),
    [
        ("lower", "lower by 1, 2 (1 to 3) m"),
        ("lower", "lower by 2 (1 to 3), 2 (1 to 3) m"),
        ("ratio", "ratio 1 (0.9 to 1.1), asked 0.95 to 1.5"),
        ("stays_below", "44 of 60 runs stay below 0.2 m; 56% to 85% of all, asked 90% at least"),
    ],
)
def test_what_no_check_says_of_such_runs_is_not_read(check, found):
    assert told(check, found) is None


def test_a_claim_of_a_paper_is_listed_once():
    """Six of Table 1 are judged of two targets, as nobody knows which the paper has."""
    studies = defaultdict(list)
    for one in paper_claims():
        studies[one.paper, one.where, one.says].append(one.study)
    twice = {key: judging for key, judging in studies.items() if len(judging) > 1}
    assert {key[:2] for key in twice} == {("002", "Table 1")}
    assert [*twice.values()] == [["paper-002-table1", "paper-002-table1-still"]] * 6


# As many as were found in the papers; who takes one away has to say so here.
LISTED = {"000": 28, "001": 6, "002": 88, "003": 9, "004": 26}


def test_no_claim_of_a_paper_is_lost():
    assert Counter(one.paper for one in paper_claims()) == LISTED


def test_what_a_study_of_a_paper_claims_is_the_papers():
    """A claim does not leave the page by being called our own."""
    of_papers = (study.load(name) for name in study.shipped() if name.startswith("paper-"))
    assert [claim.says for one in of_papers for claim in one.claims if claim.says.startswith("(our own)")] == []
