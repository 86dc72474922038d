"""Losses from outside: by an entry point or beside the scenario, with the same bits in both runtimes, refused in a line."""

import json
import subprocess
import sys

import numpy as np
import pytest
from flying import PROCESSES
from own_code import broken, write

from affinet.planning import making as planning
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.runtimes.side_by_side import side_by_side
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from netem.core.draws import Purpose, uniform
from netem.medium.verdict import Verdict
from netem.processes.user_code import UserCodeError
from world.books.history import ARRAYS, load

pytestmark = PROCESSES

FADING = """\
from dataclasses import dataclass
from typing import ClassVar

import numpy as np


@dataclass(frozen=True)
class BySquare:
    draws: ClassVar[int] = 1
    by_position: ClassVar[bool] = True
    reach: float = 5.0

    def __post_init__(self):
        if self.reach <= 0.0:
            raise ValueError("reach must be above 0 m")

    def lost(self, offered):
        squared = (offered.relative * offered.relative).sum(axis=-1)
        return offered.draw[..., 0] < squared / (self.reach * self.reach)


@dataclass(frozen=True)
class ByNight:
    day: float
    share: float = 0.5
    draws: ClassVar[int] = 1
    by_position: ClassVar[bool] = False

    def lost(self, offered):
        dark = offered.seconds % self.day >= self.day / 2.0
        return (offered.draw[..., 0] < self.share) & dark
"""
SHORT = ("time.duration=1", "time.dt=0.05", "agents.law=static", "agents.parameters={}", "network.availability=1.0")


def with_losses(*losses, coupled=True):
    profile = ", ".join(
        "{" + ", ".join(f"{key} = {json.dumps(value)}" for key, value in one.items()) + "}" for one in losses
    )
    return (
        *SHORT,
        "network.profile=mine",
        f"network.profiles.mine.loss=[{profile}]",
        f"network.coupled={str(coupled).lower()}",
    )


def planned(*losses, coupled=True, folder=None):
    return planning.make(loading.load("corridor", with_losses(*losses, coupled=coupled), folder))


@pytest.fixture
def fading(tmp_path):
    """The folder that holds the module `fading...`, and its name: beside the scenario, and on no path."""
    return tmp_path, write(tmp_path, FADING)


def verdicts(plan):
    return rehearse(plan).arrays["verdicts"]


@pytest.mark.parametrize("coupled", [True, False])
def test_losses_beside_the_scenario_fly_in_both_runtimes_with_the_same_bits(fading, out, coupled):
    folder, name = fading
    losses = (
        {"model": f"{name}:BySquare", "reach": 4},
        {"model": f"{name}:ByNight", "day": 0.5},
        {"model": "bernoulli", "p": 0.1},
    )
    plan = planned(*losses, coupled=coupled, folder=folder)
    one, many = (fly(plan, runtime, out / runtime, lambda *_: None) for runtime in ("inprocess", "processes"))
    assert one.digest == many.digest
    assert not [reason for outcome in (one, many) for reason in outcome.reasons if "proved nothing" not in reason]
    again = planning.again(out / "processes", (), verdicts=False)
    assert again.scenario.own_modules[f"{name}:ByNight"].is_relative_to(out)
    assert rehearse(again).outcome.digest == one.digest


def test_a_loss_by_an_entry_point_of_a_package_flies_over_processes(tmp_path):
    package = tmp_path / "site"
    info = package / "fading_losses-1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: fading-losses\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[affinet.impairments]\nnight = fading_losses:ByNight\n")
    (package / "fading_losses.py").write_text(FADING)
    digests = {}
    for runtime in ("inprocess", "processes"):
        sets = [f"--set={one}" for one in with_losses({"model": "night", "day": 0.5, "share": 1.0})]
        command = [
            sys.executable,
            "-c",
            "from affinet.cli.commands import command; command()",
            "run",
            "corridor",
            *sets,
        ]
        done = subprocess.run(
            [*command, "--runtime", runtime, "--out", str(tmp_path / runtime)],
            env={"PYTHONPATH": str(package), "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            cwd=tmp_path,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        summary = json.loads((tmp_path / runtime / "summary.json").read_text())
        digests[runtime] = summary["digest"]
    assert digests["inprocess"] == digests["processes"]
    book = load(tmp_path / "processes" / ARRAYS)["verdicts"]
    dark = np.arange(len(book)) * 0.05 % 0.5 >= 0.25
    assert (book[dark] == Verdict.LOST).all()
    assert not (book[~dark] == Verdict.LOST).any()


def test_one_loss_takes_no_draw_of_another(fading):
    folder, name = fading
    night = {"model": f"{name}:ByNight", "day": 0.1}
    plain, together = (
        verdicts(planned({"model": "bernoulli", "p": 0.3}, *more, folder=folder)) for more in ((), (night,))
    )
    assert (together[plain == Verdict.LOST] == Verdict.LOST).all()
    assert (together == Verdict.LOST).sum() > (plain == Verdict.LOST).sum()
    once, twice = (verdicts(planned(*[night] * number, folder=folder)) == Verdict.LOST for number in (1, 2))
    assert (twice & once == once).all()
    assert twice.sum() > 1.3 * once.sum()  # in the dark 3/4 are lost, where one draw for both would lose 1/2


def test_its_draws_are_those_of_its_name_link_and_tick():
    named = uniform(7, "mine:Loss 0", tick=3, src=1, dst=2)
    assert named == uniform(7, "mine:Loss 0", tick=3, src=1, dst=2)
    others = [
        uniform(7, purpose, tick=3, src=1, dst=2) for purpose in ("mine:Loss 1", "mine:Loss", Purpose.NAMED, *Purpose)
    ]
    assert named not in others
    seeds = np.array([5, 7], dtype=np.uint64)
    assert uniform(seeds, "mine:Loss 0", tick=3, src=1, dst=2)[1] == named


def test_runs_side_by_side_are_those_flown_alone(fading):
    folder, name = fading
    plan = planned({"model": f"{name}:BySquare"}, {"model": f"{name}:ByNight", "day": 0.3}, folder=folder)
    seed = plan.scenario.seed
    both = rehearse(side_by_side(plan, [seed, seed + 1])).arrays["verdicts"]
    assert np.array_equal(both[..., : len(plan.world.links)], verdicts(plan))


REFUSALS = [
    ({"model": "night"}, "loss.1: needs a model among bernoulli, .*, or 'module:Class', got \"night\""),
    ({"model": "{}:Nobody"}, r"network.profiles.mine.loss.1: cannot load own\d+:Nobody: own\d+ has no 'Nobody'"),
    ({"model": "{}:ByNight"}, "network.profiles.mine.loss.1.day: is missing; it has no default"),
    ({"model": "{}:ByNight", "day": "long"}, "network.profiles.mine.loss.1.day: should be a number"),
    (
        {"model": "{}:ByNight", "day": 1.0, "shar": 1.0},
        "network.profiles.mine.loss.1.shar: unknown; did you mean 'share'",
    ),
    ({"model": "{}:BySquare", "reach": -1.0}, "network.profiles.mine.loss.1: reach must be above 0 m"),
]


@pytest.mark.parametrize(("loss", "says"), REFUSALS)
def test_what_is_wrong_in_the_scenario_is_said_of_its_key(fading, loss, says):
    folder, name = fading
    with pytest.raises(ScenarioError, match=says):
        planned({**loss, "model": loss["model"].format(name)}, folder=folder)


def test_a_profile_that_is_not_in_use_is_checked_too(fading):
    folder, name = fading
    spare = f'network.profiles.spare.loss=[{{ model = "{name}:BySquare", reach = "far" }}]'
    with pytest.raises(ScenarioError, match=r"network\.profiles\.spare\.loss\.1\.reach: should be a number"):
        planning.make(loading.load("corridor", (*SHORT, spare), folder))


ATTRIBUTES = "    draws: ClassVar[int] = 1\n    by_position: ClassVar[bool] = False\n"
NO_METHOD = ("def lost(self, offered):\n        dark", "def gone(self, offered):\n        dark")
WRONG = [
    (
        ("(offered.draw[..., 0] < self.share) & dark", "offered.draw"),
        r"tick 0: what is lost must be bool \(\.\.\., C, n\)",
    ),
    (("self.share) & dark", "self.share) & None"), "lost in tick 0: TypeError"),
    ((ATTRIBUTES, ""), "has no 'by_position'"),
    (NO_METHOD, "has no method lost: Loss in docs/extending.md"),
    ((ATTRIBUTES, ATTRIBUTES.replace("= 1", "= -1")), "'draws' is -1: how many uniform numbers"),
]


@pytest.mark.parametrize(("change", "says"), WRONG)
def test_what_a_loss_does_wrong_is_said_as_its_own(tmp_path, change, says):
    name = write(tmp_path, broken(FADING, change))
    with pytest.raises(UserCodeError, match=says):
        planned({"model": f"{name}:ByNight", "day": 1.0}, folder=tmp_path)


def test_a_loss_that_fails_in_flight_says_the_same_in_both_runtimes(tmp_path, out):
    late = ("dark = offered", "1 / (offered.tick != 7)\n        dark = offered")
    name = write(tmp_path, broken(FADING, late))
    plan = planned({"model": f"{name}:ByNight", "day": 1.0}, folder=tmp_path)
    for runtime in ("inprocess", "processes"):
        outcome = fly(plan, runtime, out / runtime, lambda *_: None)
        assert outcome.verdict == "fail"
        assert any(f"{name}:ByNight.lost in tick 7: ZeroDivisionError" in reason for reason in outcome.reasons), (
            outcome.reasons
        )
