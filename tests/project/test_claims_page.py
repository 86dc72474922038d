"""docs/claims/ is what its script writes, of all claims that shipped studies of papers make, and of tests that are there."""

import ast

import claims_page
import paper_claims
import pytest
from paths import DOCS, ROOT

from affinet.studies import record, study
from analysis.claims.intervals import Decision

ROWS = paper_claims.paper_claims()
TESTS = sorted({test for one in ROWS for test in one.tests})


PAGES = claims_page.pages()


@pytest.mark.parametrize("file", PAGES)
def test_a_page_is_what_its_script_writes(file):
    written = (DOCS / file).read_text(encoding="utf-8")
    assert written == PAGES[file], "`python docs/claims_page.py` writes it again"


def test_there_are_no_other_pages():
    assert {f"claims/{file.name}" for file in (DOCS / "claims").iterdir()} == {*PAGES} - {"claims.md"}


@pytest.mark.parametrize("name", [name for name in study.shipped() if name.startswith("paper-")])
def test_every_claim_of_a_study_of_a_paper_is_on_the_page(name):
    made = {claim.says for claim in study.load(name).claims if not claim.says.startswith("(our own)")}
    assert made <= {says for one in ROWS if one.study == name for says in one.claims}


@pytest.mark.parametrize("test", TESTS)
def test_what_judges_a_claim_is_there(test):
    path, _, name = test.partition("::")
    names = {node.name for node in ast.parse((ROOT / path).read_text()).body if isinstance(node, ast.FunctionDef)}
    assert name in names


def test_a_claim_that_no_study_makes_is_not_passed_over():
    first = next(one for one in ROWS if one.study)
    wrong = first.model_copy(update={"claims": ["what nobody says"]})
    with pytest.raises(KeyError, match="makes no claim 'what nobody says'"):
        list(paper_claims.verdicts(wrong, study.load(first.study)))


@pytest.mark.parametrize("left_out", ["study", "claims"])
def test_what_judges_a_claim_has_to_be_said(left_out):
    first = next(one for one in ROWS if one.study).model_dump()
    del first[left_out]
    with pytest.raises(ValueError, match=r"go together|name the claims of a study, tests, or why"):
        paper_claims.PaperClaim.model_validate(first)


def test_cases_that_come_out_alike_are_counted_and_the_others_named():
    def found(case, decision):
        judged = record.JudgedClaim(says="s", asked="a", decision=Decision(decision), found="1 (0 to 2)")
        return paper_claims.Found("s", case, judged)

    cases = [
        *(found(f"case {n}", "holds") for n in range(5)),
        found("odd", "undecided"),
        paper_claims.Found("s", "late", None),
    ]
    assert list(claims_page._summed_up("it flies", cases)) == [
        "it flies: holds in 5 of 7 cases (case 0; case 1; case 2; case 3; case 4)",
        "odd: it flies: **undecided**: 1 (0 to 2)",
        "late: it flies: not flown in full yet",
    ]
    assert list(claims_page._summed_up("", cases[:1])) == ["case 0: holds: 1 (0 to 2)"]


STUDIES = {name: study.load(name) for name in study.shipped()}


def judged_as(monkeypatch, *decisions):
    """A claim of a paper on a study in as many cases, and what came of each; None is of one that was not flown."""
    found = [
        paper_claims.Found("s", "", each and record.JudgedClaim(says="s", asked="a", decision=Decision(each), found=""))
        for each in decisions
    ]
    monkeypatch.setattr(paper_claims, "verdicts", lambda *_: iter(found))
    return next(one for one in ROWS if one.study and not one.tests)


@pytest.mark.parametrize(
    ("decisions", "came"),
    [
        (["holds", "holds"], "holds"),
        (["holds", "undecided"], "undecided"),
        (["holds", None], paper_claims.NOT_ALL_FLOWN),
        (["undecided", None], paper_claims.NOT_ALL_FLOWN),
        ([None], paper_claims.NOT_ALL_FLOWN),
        (["does not hold", None, "holds"], "does not hold"),
    ],
)
def test_a_claim_holds_where_it_does_in_all_of_its_cases(decisions, came, monkeypatch):
    one = judged_as(monkeypatch, *decisions)
    assert paper_claims.outcome(one, STUDIES[one.study]) == came


def test_a_claim_by_tests_holds_and_one_by_nothing_is_not_judged():
    tested = next(one for one in ROWS if one.tests and not one.study)
    assert paper_claims.outcome(tested, None) == "holds"
    assert paper_claims.outcome(tested.model_copy(update={"tests": []}), None) == "not judged"


def test_claims_are_counted_once_and_verdicts_once():
    """Before: one table had claims in a column and their cases in the next."""
    lines = [line.strip("| ").split(" | ") for line in claims_page._tally(ROWS, STUDIES) if line.startswith("| 0")]
    of_claims, of_verdicts = lines[: len(paper_claims.PAPERS)], lines[len(paper_claims.PAPERS) :]
    for paper, all_of_them, *numbers in of_claims + of_verdicts:
        assert int(all_of_them) == sum(map(int, numbers)), paper
    assert sum(int(line[1]) for line in of_claims) == len(ROWS)
    asked = [each for one in ROWS if one.study for each in paper_claims.verdicts(one, STUDIES[one.study])]
    assert sum(int(line[1]) for line in of_verdicts) == len(asked)


@pytest.mark.parametrize(("paper", "name"), sorted({(one.paper, one.study) for one in ROWS if one.study}))
def test_the_pages_say_how_to_fly_a_study_again_and_which_file_its_figures_are_from(paper, name):
    claimed, group = PAGES[f"claims/{paper}.md"], claims_page.group_of(name)
    assert f"`affinet study {name}`" in claimed
    flown = record.full_study(name) is not None
    assert (f"(../../affinet/shipped/results/{name}.json)" in PAGES[f"claims/{group}.md"]) == flown
    assert (f"[means]({'' if group == paper else f'{group}.md'}#{name})" in claimed) == flown


OWN = sorted(
    name for name in STUDIES.keys() - {one.study for one in ROWS} if (full := record.full_study(name)) and full.claims
)


@pytest.mark.parametrize("name", OWN)
def test_verdicts_on_our_own_claims_are_beneath_the_means(name):
    page = PAGES[f"claims/{claims_page.group_of(name)}.md"]
    written = page.partition(f"### {name}\n")[2].partition("\n### ")[0]
    assert all(f"| {claim.says} | " in written for claim in record.full_study(name).claims)


def test_verdicts_on_claims_of_papers_are_not_said_again():
    assert sum(page.count("| our own claim |") for page in PAGES.values()) == len(OWN) > 0


@pytest.mark.parametrize(
    ("quantity", "low", "said"), [("error", -0.1, True), ("error", 0.1, False), ("fall", -0.1, False)]
)
def test_intervals_of_squares_that_reach_below_0_are_said_to_be_of_few_runs(quantity, low, said):
    full = record.full_study("bursts")
    case = full.cases[0].model_copy(update={"quantity": quantity, "low": low})
    lines = list(claims_page._scattered(full.model_copy(update={"cases": [case]})))
    assert any("few runs make the mean" in line for line in lines) == said
