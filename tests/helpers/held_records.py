"""What is wrong with the record of a full study, against the study that it is of, and against itself."""

from types import SimpleNamespace

from read_verdicts import Runs, read

from affinet.studies import judging, record, study
from affinet.studies.quantities import said
from analysis.claims import intervals
from analysis.claims.intervals import Decision

# Whether ratios rise from case to case has an interval that the verdict does not tell.
NOT_TOLD = {  # by source and claim, with what was decided
    (
        "paper 000, Fig. 12 a, b",
        "zhao7: conRAL deteriorates to the case of no estimator as lambda falls",
    ): Decision.UNDECIDED,
    (
        "paper 000, Fig. 12 a, b",
        "hexa10: conRAL deteriorates to the case of no estimator as lambda falls",
    ): Decision.UNDECIDED,
}
_EXACT = 1e-12


def faults(of, full):
    """Everything that is wrong with a record (`StudyRecord`) of a study, a line each."""
    spelled = [*judging.all_spelled_out(of)]
    if [(one.says, one.asked) for one in full.claims] != [(one.says, record.asked(of, one)) for one in spelled]:
        yield "its claims are not those of the study, one by one"
    header = (of.title, of.source, False, of.full.runs, intervals.CONFIDENCE)
    if (full.title, full.source, full.quick, full.runs, full.confidence) != header:
        yield "its title, source, runs or confidence are not those of the study"
    if full.flown != record.grid(of, quick=False):
        yield "it is of another grid"
    cases = [*study.cases(of, quick=False)]
    means = [(case.labels, name, said(name)[1]) for case in cases for name in _quantities(of, spelled)]
    if [(one.labels, one.quantity, one.unit) for one in full.cases] != means:
        yield "its means are not those of the cases and quantities of the study, one by one"
    yield from (f"{one.labels} {one.quantity}: {wrong}" for one in full.cases for wrong in _wrong_mean(one))
    for claim, judged, runs in verdicts(of, full):
        yield from (f"{judged.says}: {wrong}" for wrong in wrong_verdict(full, claim, judged, runs))


def verdicts(of, full):
    """Each claim that is spelled out, what was judged in its place, and what is known of the runs it looks at."""
    flown = [
        SimpleNamespace(labels=case.labels, plan=SimpleNamespace(scenario=of.loaded(case.overrides)))
        for case in study.cases(of, quick=False)
    ]
    for claim, judged in zip(judging.all_spelled_out(of), full.claims, strict=False):
        yield claim, judged, _runs_of(of, full, claim, flown)


def wrong_verdict(full, claim, judged, runs):
    """What is wrong with a verdict of a record: with what it says that was found, and with what follows from that."""
    told = read(claim, judged.found, runs)
    if told is None:
        yield f"nobody says {judged.found!r} of such runs"
        return
    yield from (f"{judged.found!r}: {wrong}" for wrong in told.wrong)
    listed = NOT_TOLD.get((full.source, judged.says))
    if judged.decision not in told.decisions or judged.decision != (listed or judged.decision):
        yield f"{judged.decision} does not follow from {judged.found!r}"
    if len(told.decisions) > 1 and not listed:
        yield f"{judged.found!r} does not tell what was decided: list it in NOT_TOLD"


def _quantities(of, spelled):
    compared = (name for one in spelled for name in (one.quantity or of.quantity, one.to_quantity))
    return dict.fromkeys([of.quantity, *filter(None, compared)])


def _wrong_mean(one):
    """Student's interval is as wide above as below; of what overflows there are no ends."""
    if one.low is None or one.high is None or one.found is None:
        if (one.low, one.high) != (None, None):
            yield "half an interval"
        return
    far = abs(one.found - (one.low + one.high) / 2.0)
    if not one.low <= one.found <= one.high or far > _EXACT * max(abs(one.low), abs(one.high)):
        yield f"{one.found} ({one.low} to {one.high}) is no interval"


def _runs_of(of, full, claim, flown):
    """What is known of the runs that a claim looks at, without having them."""
    quantity = claim.quantity or of.quantity
    whole = claim.until is None and claim.since == of.since

    def means(labels, name):
        those = (one for one in full.cases if one.quantity == name and study.selected(one, labels))
        return [*those] if whole and labels is not None else None

    compared = [one for labels in (claim.of, claim.to or {}) for one in flown if study.selected(one, labels)]
    return Runs(
        of.full.runs,
        len([one for one in flown if study.selected(one, claim.of)]),
        said(quantity)[1],
        judging._paired(compared),
        means(claim.of, quantity),
        means(claim.to, claim.to_quantity or quantity),
    )
