"""What a person at a terminal sees: progress on standard error, tables on standard output."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich import progress as bar
from rich.console import Console
from rich.table import Table
from rich.text import Text

from affinet.cli.progress import Bar, left
from affinet.planning.plan import Plan
from affinet.runtimes import directories
from affinet.verdicts import told
from affinet.verdicts.outcome import Outcome
from affinet.verdicts.refused import by_sender
from affinet.verdicts.timing import DelayError, Lateness, Timing
from analysis.models.finding import Finding
from netem.core.listing import listed
from netem.faults.control import Answer
from netem.wire.certificates import AUTHORITY
from netem.wire.session import DRIVER, HUB, WORLD

if TYPE_CHECKING:
    from affinet.planning.designing import Designed
    from affinet.studies.record import StudyRecord
    from affinet.studies.study import Result
    from netem.wire.authority import Made

_SAYS = "{task.fields[says]}"
_LEVELS = {"ok": "[green]ok[/]", "note": "[yellow]note[/]", "error": "[red]error[/]"}
_DECISIONS = {
    "holds": "[green]holds[/]",
    "does not hold": "[red]does not hold[/]",
    "undecided": "[yellow]undecided[/]",
}
_VERDICTS = {"pass": "[green]pass[/]", "fail": "[red]fail[/]", "vacuous": "[yellow]vacuous[/]"}


class Progress:
    """How a run goes, with the real-time factor, on standard error."""

    def __init__(self, plan: Plan, name: str, out: Path) -> None:
        self._name, self._out = name, out
        self._dt = plan.world.dt
        self._first: tuple[int, float] | None = None
        self._bar = Bar(
            name, plan.world.ticks, bar.BarColumn(), bar.TextColumn(_SAYS), bar.TimeRemainingColumn(), says="starting"
        )

    def __enter__(self) -> Progress:
        self._bar.tell(f"{self._name} flies in {self._out}")
        self._bar.__enter__()
        return self

    def __exit__(self, *failure: object) -> None:
        self._bar.__exit__(*failure)

    def see(self, tick: int, error: float) -> None:
        """Show how far it is."""
        now = time.perf_counter()
        self._first = self._first or (tick, now)
        elapsed = now - self._first[1]
        factor = f"{(tick - self._first[0]) * self._dt / elapsed:4.1f} x real time" if elapsed > 0.0 else ""
        off = "" if math.isnan(error) else f"error {error:.4f} m²  "  # where nobody knows where agents are
        self._bar.see(tick, f"{tick * self._dt:6.2f} s  {off}{factor}")


class Grid:
    """How far a study is, and about how long it takes on, on standard error: a bar, or a line for each case.

    Parameters
    ----------
    title
        Of the study.
    ticks
        Of each case, by which it takes its part of the time.
    now
        The time, in seconds.
    there
        Which share of each has flown before; none, if it is not given.
    """

    def __init__(
        self,
        title: str,
        ticks: Sequence[int],
        now: Callable[[], float] = time.perf_counter,
        there: Sequence[float] = (),
    ) -> None:
        self._title, self._ticks, self._now = title, ticks, now
        self._shares, self._done = list(there) or [0.0] * len(ticks), 0
        self._before = self._flown / sum(ticks)
        self._began = now()
        self._bar = Bar(title, sum(ticks), bar.BarColumn(), bar.TextColumn(_SAYS), says=self._says(), every_s=math.inf)

    def __enter__(self) -> Grid:
        self._bar.__enter__()
        return self

    def __exit__(self, *failure: object) -> None:
        self._bar.__exit__(*failure)

    def look(self, shares: Sequence[float]) -> None:
        """Show which share of each case has flown."""
        self._shares = [*([1.0] * self._done), *shares[self._done :]]
        self._bar.see(self._flown, self._says())

    def see(self, result: Result) -> None:
        """Show that a case is done."""
        self._done += 1
        self._shares[self._done - 1] = 1.0
        self._bar.see(self._flown, self._says())
        if not self._bar.is_at_a_terminal:
            self._bar.tell(f"{self._title}: {self._says()}  {', '.join(result.labels.values())}")

    @property
    def _flown(self) -> float:
        return sum(share * ticks for share, ticks in zip(self._shares, self._ticks, strict=True))

    def _says(self) -> str:
        share = self._flown / sum(self._ticks)
        said = (
            f"{self._done}/{len(self._ticks)} cases",
            f"{int(100 * share)} %",
            left(
                self._now() - self._began, (share - self._before) / max(1.0 - self._before, share - self._before, 1e-9)
            ),
        )
        return "  ".join(filter(None, said))


def claims(judged: StudyRecord, full: StudyRecord | None, out: Path) -> None:
    """What a study says of the claims it examines, and where a quick one contradicts the full one."""
    quick = f", quick: {judged.runs} runs of a coarse form" if judged.quick else ""
    table = Table("claim", "", "found", title=plain(f"{judged.title} ({judged.source}){quick}"))
    for claim in judged.claims:
        table.add_row(plain(claim.says), _DECISIONS[claim.decision], plain(claim.found))
    console = Console()
    console.print(table)
    if judged.quick and full is not None:
        for other in judged.contradicted(full):
            said = f"{other.says}: in the full study, of {full.runs} runs, it {other.decision}: {other.found}"
            console.print(plain(said))
    console.print(plain(f"data and figure in {out}"))


def designed(made: Designed, file: Path) -> None:
    """What a formation has become, and how to fly it."""
    formation = made.formation
    has = f"{formation.agents} agents, {len(formation.edges)} edges, {len(formation.leaders)} leaders"
    print(f"{has}: what is slowest settles to 1/e in {made.settles:.1f} s")  # noqa: T201
    print(f"{file}: affinet run {directories.on_a_command_line(file)} --runtime inprocess")  # noqa: T201


def keys(folder: Path, made: Made) -> None:
    """Which certificates were made, and what to do with them."""
    of = "the authority that was there" if made.renewed else "a new authority"
    print(  # noqa: T201
        f"{folder}: certificates of {of} for {len(made.names)} names until {made.ends:%Y-%m-%d %H:%M} UTC; "
        f"the hub is reached at {listed(made.addresses)}\n"
        f"copy to each machine {AUTHORITY}.pem, and NAME.pem and NAME.key of the processes there; "
        f"{AUTHORITY}.key makes certificates, and stays here"
    )


def outcome(outcome: Outcome, plan: Plan) -> None:
    """What came of a run."""
    table = Table(show_header=False, title=_titled(outcome))
    flown, messages = outcome.flown, outcome.messages
    errors = {name.replace("_", " "): (of, "m") for name, of in outcome.errors.items()}
    if not errors and not plan.may_have_gaps:
        errors = {"tracking error": (outcome.tracking_error, "m²")}
    rows = [
        ("estimator, law", f"{flown['estimator']}, {flown['law']}"),
        ("seed", f"{flown['seed']}"),
        ("versions", ", ".join(f"{name} {version}" for name, version in flown["versions"].items())),
        ("flown", f"{outcome.ticks} ticks, {outcome.ticks * plan.world.dt:g} s in {outcome.wall_s:.1f} s"),
        ("speed", f"{outcome.ticks_per_s:.0f} ticks/s, {outcome.real_time_factor:.2f} x real time"),
        *(
            (what, "  ".join(f"{name} {_figure(value)} {unit}" for name, value in of.items()))
            for what, (of, unit) in errors.items()
        ),
        (
            "messages",
            f"{messages['offered']} offered, {messages['copies']} doubled, "
            f"{messages['delivered']} delivered, {messages['in_flight']} in flight",
        ),
        (
            "dropped",
            ", ".join(f"{reason} {number}" for reason, number in messages["dropped"].items()) or "none",
        ),
        ("lost by nobody's order", f"{messages['uninstructed']}"),
        *([("lost by the transport", f"{lost}, and asked for again")] if (lost := messages["transport_lost"]) else []),
        *((f"wrong, of {who}", what) for who, what in by_sender(outcome.refused).items()),
        *(("fault", str(bite)) for bite in outcome.faults),
        *(("jammed zone", str(jam)) for jam in outcome.zones),
        *([] if outcome.timing is None else _timing(outcome.timing)),
        ("digest", str(outcome.digest)),
        ("directory", outcome.out),
    ]
    for name, value in rows:
        table.add_row(name, plain(value))
    console = Console()
    console.print(table)
    if outcome.verdict.startswith("pass"):
        console.print(plain(told.OF_PASS), style="dim")
    for reason in outcome.reasons:
        console.print(plain(reason), soft_wrap=True)


def _titled(outcome: Outcome) -> str:
    """What came of it, in its colour."""
    verdict = outcome.verdict.partition(",")[0]
    return outcome.says.replace(verdict, _VERDICTS[verdict], 1)


def _timing(timing: Timing) -> list[tuple[str, str]]:
    """How processes of a run in real time kept their time: the worst of the agents stands for them all."""
    agents = {name: of for name, of in timing.lateness.items() if name not in (WORLD, HUB, DRIVER)}
    worst = sorted(agents, key=lambda name: (agents[name].p99_ms, name))[-1:]
    shown = [name for name in (WORLD, HUB, DRIVER, *worst) if name in timing.lateness]
    missed = [f"{name} {of.missed}" for name, of in timing.lateness.items() if of.missed]
    rows = [
        ("late", "; ".join(f"{name} {_milliseconds(timing.lateness[name])}" for name in shown)),
        ("deadlines missed", ", ".join(missed) or "none"),
    ]
    if timing.delays is not None:
        rows.append(("delays longer by", _milliseconds(timing.delays)))
    return rows


def _milliseconds(of: Lateness | DelayError) -> str:
    return f"p50 {of.p50_ms:.2f}, p99 {of.p99_ms:.2f}, max {of.max_ms:.2f} ms"


def findings(title: str, found: Sequence[Finding]) -> None:
    """What was checked."""
    table = Table("check", "", "says", title=plain(title))
    for finding in found:
        table.add_row(plain(finding.check), _LEVELS[finding.level], plain(finding.says))
    Console().print(table)


def answer(told: Answer, dt: float) -> None:
    """What the medium says it holds."""
    console = Console()
    console.print(f"from tick {told.k} ({told.k * dt:.2f} s) on:", highlight=False)
    for line in told.holds or ["nothing is imposed"]:
        console.print(plain(f"  {line}"))


def plain(text: str) -> Text:
    """Text of a user's as it stands: no markup, no emoji, and nothing that moves the terminal's cursor."""
    return Text("".join(letter if letter.isprintable() or letter == "\n" else repr(letter)[1:-1] for letter in text))


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
