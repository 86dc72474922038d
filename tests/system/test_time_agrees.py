"""A scenario in lockstep and in real time: tracking error, loss, age of information and delay are distributed alike."""

import numpy as np
import pytest
from flying import PROCESSES, plan_of

from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from netem.medium import deliveries
from netem.medium.verdict import Verdict
from world.books import history

pytestmark = [PROCESSES, pytest.mark.slow]

DT = 0.05
AIR = (
    f"time.dt={DT}",
    "time.duration=8",
    "record.enabled=false",
    'agents.estimator="rkf"',
    'network.profiles.slow={delay={model="uniform",mean=0.06,jitter=0.05}}',
    'network.profile="slow"',
)
SETTLED = slice(40, None)  # ticks


class Distributions:
    """Of a run: what is compared."""

    def __init__(self, arrays, delays_s):
        verdicts, newest = arrays["verdicts"][:, 1:], arrays["newest"][:, 1:].astype(float)
        offered = (verdicts != Verdict.SILENT) & (verdicts != Verdict.UNSAID)
        self.loss = ((verdicts == Verdict.LOST) & offered).sum() / offered.sum()
        latest = np.maximum.accumulate(newest, axis=0)
        ages = (np.arange(len(newest))[:, None, None] - latest)[SETTLED]
        self.age = ages[latest[SETTLED] >= 0] * DT
        self.error = arrays["error"][SETTLED]
        self.delay = delays_s


def apart(one, other):
    """In what two runs are not distributed alike."""
    found = []
    if abs(one.loss - other.loss) > 0.02:
        found.append("loss")
    if abs(one.age.mean() - other.age.mean()) > DT:
        found.append("age of information")
    ratio = np.median(one.error) / np.median(other.error)
    if not 0.5 < ratio < 2.0:
        found.append("tracking error")
    # In lockstep a delay ends with the tick in which it does.
    if abs(one.delay.mean() - other.delay.mean()) > DT or abs(one.delay.std() - other.delay.std()) > DT / 2:
        found.append("delay")
    return found


def in_lockstep(*overrides):
    plan = plan_of("corridor", *AIR, *overrides)
    arrays = rehearse(plan).arrays
    return Distributions(arrays, _waited(arrays))


def _waited(arrays):
    """How long what arrives late was under way in lockstep, in seconds, as far as a tick tells."""
    newest = arrays["newest"][:, 1:]
    ticks = np.arange(len(newest))[:, None, None] - newest
    return (ticks[newest >= 0] * DT).astype(float)


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """In real time, slower and slower until hardly anything is unsaid."""
    for factor in (0.5, 0.2, 0.1):
        out = tmp_path_factory.mktemp("agree") / "run"
        clock = ('time.mode="real"', f"time.real.factor={factor}", "time.real.late=60")
        outcome = fly(plan_of("corridor", *AIR, "network.availability=0.7", *clock), "processes", out, lambda *_: None)
        assert outcome.verdict == "pass", outcome.reasons
        if outcome.messages["dropped"].get("unsaid", 0) < 0.01 * outcome.messages["offered"]:
            break
    taken = deliveries.read(out / deliveries.FILE)["taken_s"].to_numpy().astype(float)
    return Distributions(history.load(out / history.ARRAYS), taken)


def test_they_agree(real):
    assert not apart(real, in_lockstep("network.availability=0.7"))


def test_another_seed_in_lockstep_agrees_too():
    assert not apart(in_lockstep("network.availability=0.7"), in_lockstep("network.availability=0.7", "seed=2"))


@pytest.mark.parametrize(
    ("other", "what"),
    [
        (("network.availability=0.5",), "loss"),
        (("network.availability=0.7", "network.delay_ticks=2"), "delay"),
        (("network.availability=0.7", "network.delay_ticks=2"), "age of information"),
        (("network.availability=0.7", "sensing.sigma=1.0"), "tracking error"),
    ],
)
def test_what_is_not_alike_is_told_apart(real, other, what):
    assert what in apart(real, in_lockstep(*other))
