"""Every shipped study has a record, and it is the study's, and agrees with itself. Whoever edits one is found out."""

from collections import Counter

import claims_page
import pytest
from held_records import READ, faults, intervals_in

from affinet.studies import record, study
from analysis.claims.intervals import Decision

FOUR = study.load("paper-001-fig4")
FULL = record.full_study("paper-001-fig4")


def test_every_study_has_a_record_and_every_record_a_study():
    assert {file.stem for file in claims_page.RESULTS.glob("*")} == set(study.shipped())


@pytest.mark.parametrize("name", study.shipped())
def test_a_record_is_that_of_its_study_and_agrees_with_itself(name):
    assert [*faults(study.load(name), record.full_study(name))] == [], f"fly {name} again, or take its record away"


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


@pytest.mark.parametrize(
    ("check", "found", "decision"),
    [
        ("ratio", "ratio 0.15 (0.14 to 0.16), asked 0.95 to 1.05", "holds"),
        ("ratio", "ratio 1 (0.9 to 1.1), asked 0.95 to 1.05", "holds"),
        ("ratio", "ratio 1 (0.99 to 1.01), asked 0.95 to 1.05", "undecided"),
        ("stays_below", "44 of 50 runs stay below 0.2 m²; 73% to 96% of all, asked 90% at least", "holds"),
        ("stays_below", "50 of 50 runs stay below 0.2 m²; 91% to 100% of all, asked 90% at least", "undecided"),
        ("flat", "largest over smallest 3 (2.9 to 3.1), allowed 2: 3, 1 m²", "holds"),
        ("indicator_below_error", "at 599 of 600 moments, for all 4; closest 0.1", "holds"),
        ("indicator_follows_error", "least rank correlation 0.887 (0.855 to 0.919), asked 0.9", "holds"),
        ("slower_with_anchor", "19 of 20 are not above; in the mean 1 against 2", "holds"),
        ("lower", "lower by 1, 2 (1 to 3) m", "undecided"),
    ],
)
def test_what_does_not_follow_from_what_was_found_is_seen(check, found, decision):
    claim = next(one for name in study.shipped() for one in study.load(name).claims if one.check == check)
    judged = record.JudgedClaim(says="", asked="", decision=Decision(decision), found=found)
    told = intervals_in(found)
    assert judged.decision not in READ[check](claim, found, told)


def test_a_claim_of_a_paper_is_listed_once():
    listed = Counter((one.paper, one.where, one.says, one.study) for one in claims_page.paper_claims())
    assert max(listed.values()) == 1


# As many as were found in the papers; who takes one away has to say so here.
LISTED = {"000": 28, "001": 6, "002": 88, "003": 9, "004": 26}


def test_no_claim_of_a_paper_is_lost():
    assert Counter(one.paper for one in claims_page.paper_claims()) == LISTED


def test_what_a_study_of_a_paper_claims_is_the_papers():
    """A claim does not leave the page by being called our own."""
    of_papers = (study.load(name) for name in study.shipped() if name.startswith("paper-"))
    assert [claim.says for one in of_papers for claim in one.claims if claim.says.startswith("(our own)")] == []
