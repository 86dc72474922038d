"""An agent's state on disk: every estimator and law goes on from it bit for bit, whenever its process dies."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from flying import plan_of
from offered import by_affinet
from own_code import ESTIMATOR
from paths import HELPERS

from affinet.scenario.bodies import INTEGRATORS
from agents import checkpoint
from agents.agent import Agent
from agents.exchange import Heard
from analysis.models.pursuit import Sighting
from netem.core.channels import CENTRE

ESTIMATORS, LAWS = by_affinet("estimators"), by_affinet("controllers")
SINGLE = {"edge-kf", "joint-kf", "silent-kf", "crkf"}  # they predict by inputs that are velocities
PAIRS = [
    (estimator, law)
    for estimator, law in product(sorted(ESTIMATORS.names), sorted(LAWS.names))
    if not (estimator in SINGLE and LAWS[law].load()().order == 2) and (estimator == "target") == (law == "pursuit")
]
TICKS = 6
FORGETFUL = {"none", "mle", "ral", "crkf"}  # they say what the tick says


def agent_of(estimator, law):
    plan = plan_of("target" if estimator == "target" else "corridor")
    return Agent(
        plan.brief.of(4),
        ESTIMATORS[estimator].load()(),
        LAWS[law].load()(),
        leaders="pilot",
        leader_gain=1.0,
        limit=None,
    )


def leaves(state):
    return [leaf for part in state for leaf in leaves(part)] if isinstance(state, tuple) else [np.asarray(state)]


def assert_equal_bits(one, other):
    assert len(leaves(one)) == len(leaves(other)) > 0
    for here, there in zip(leaves(one), leaves(other), strict=True):
        assert (here.dtype, here.shape, here.tobytes()) == (there.dtype, there.shape, there.tobytes())


def lives(agent, state, ticks, seed, first=0):
    """An agent's states and inputs while it sees and hears this and that."""
    rng, slots = np.random.default_rng(seed), agent.brief.present.shape
    told = []
    for tick in range(first, first + ticks):
        seen = (rng.random(slots) < 0.8) & agent.brief.present
        measured = np.where(
            seen[:, None], agent.brief.relative + 0.1 * rng.normal(size=agent.brief.relative.shape), 0.0
        )
        motion = rng.normal(size=(agent.law.order - 1, agent.brief.dimension)) if agent.law.order > 1 else None
        state, _ = agent.sense(state, tick, measured, seen, motion)
        fresh = (rng.random(slots) < 0.8) & agent.brief.present
        heard = {
            channel: Heard(
                {name: rng.normal(size=(*slots, *field.shape)).astype(field.dtype) for name, field in fields.items()},
                fresh,
            )
            for channel, fields in agent.channels().items()
        }
        spread = rng.normal(size=(*measured.shape, measured.shape[-1]))
        centre = {"relative": measured, "covariance": spread, "nis": rng.random(slots)}
        heard[CENTRE] = Heard(centre, np.ones(slots, dtype=bool))
        position, sighting = None, None
        if agent.brief.target is not None:
            position = rng.normal(size=agent.brief.dimension)
            sighting = Sighting(position + 1.0, np.array(rng.random() < 0.4), *rng.integers(2, size=2))
        state, action = agent.act(state, tick, heard, position, motion, sighting)
        told.append(np.concatenate([np.ravel(said) for said in (action.input, *action.estimate.reports.values())]))
    return state, np.array(told)


def lived_on(agent, file):
    """What an agent commands and reports after a checkpoint, as it would have without one; and a fresh agent instead."""
    state, _ = lives(agent, agent.init(()), TICKS, seed=1)
    checkpoint.save(file, state)
    loaded = checkpoint.load(file, like=agent.init(()))
    assert_equal_bits(loaded, state)
    assert repr(type(loaded.estimator)) == repr(type(state.estimator))
    later, told = lives(agent, state, TICKS, seed=2, first=TICKS)
    later_too, told_too = lives(agent, loaded, TICKS, seed=2, first=TICKS)
    assert_equal_bits(later_too, later)
    assert told_too.tobytes() == told.tobytes()
    _, of_nobody = lives(agent, agent.init(()), TICKS, seed=2, first=TICKS)
    return told, of_nobody


@pytest.mark.parametrize(("estimator", "law"), PAIRS)
def test_every_estimator_and_law_goes_on_from_its_checkpoint_bit_for_bit(estimator, law, tmp_path):
    told, of_nobody = lived_on(agent_of(estimator, law), tmp_path / "agent.npz")
    assert estimator in FORGETFUL or law == "rest" or of_nobody.tobytes() != told.tobytes()


@pytest.mark.parametrize("order", [1, 3, 4])
def test_who_pursues_by_derivatives_of_any_order_goes_on_from_its_checkpoint(order, tmp_path):
    agent = plan_of(
        "target",
        f"target.order={order}",
        f"dynamics.model={INTEGRATORS[order - 1]}",
        f"agents.parameters.pursuit.kappa={np.poly(np.full(order, -1.0))[:0:-1].tolist()}",
        'agents.parameters.target={fusion="mean"}',
    ).agents
    told, of_nobody = lived_on(replace(agent, brief=agent.brief.of(4)), tmp_path / "agent.npz")
    assert of_nobody.tobytes() != told.tobytes()


def test_numbers_that_are_none_and_zeros_below_zero_come_back_as_they_were(tmp_path):
    agent = agent_of("rkf", "constant-velocity")
    state = agent.init(())._replace(input=np.array([-0.0, np.nan]))
    checkpoint.save(tmp_path / "agent.npz", state)
    assert_equal_bits(checkpoint.load(tmp_path / "agent.npz", like=agent.init(())), state)


@pytest.fixture
def two_states():
    agent = agent_of("ga-rkf", "constant-velocity")
    first, _ = lives(agent, agent.init(()), 2, seed=1)
    second, _ = lives(agent, first, 2, seed=2, first=2)
    return agent, first, second


def test_the_last_state_that_was_saved_is_the_one_that_is_loaded(two_states, tmp_path):
    agent, first, second = two_states
    for state in (first, second):
        checkpoint.save(tmp_path / "agent.npz", state)
    assert_equal_bits(checkpoint.load(tmp_path / "agent.npz", like=agent.init(())), second)
    assert [file.name for file in tmp_path.iterdir()] == ["agent.npz"]


class Death(BaseException):
    pass


def die_halfway(file, *_, **__):
    Path(file).write_bytes(b"PK\x03\x04 half a state")
    raise Death


def test_a_death_while_it_is_written_leaves_the_state_before(two_states, tmp_path, monkeypatch):
    agent, first, second = two_states
    checkpoint.save(tmp_path / "agent.npz", first)
    with monkeypatch.context() as dying:
        dying.setattr(np, "savez", die_halfway)
        with pytest.raises(Death):
            checkpoint.save(tmp_path / "agent.npz", second)
    assert_equal_bits(checkpoint.load(tmp_path / "agent.npz", like=agent.init(())), first)
    checkpoint.save(tmp_path / "agent.npz", second)
    assert_equal_bits(checkpoint.load(tmp_path / "agent.npz", like=agent.init(())), second)


def test_a_death_while_the_first_is_written_leaves_none(two_states, tmp_path, monkeypatch):
    agent, first, _ = two_states
    monkeypatch.setattr(np, "savez", die_halfway)
    with pytest.raises(Death):
        checkpoint.save(tmp_path / "agent.npz", first)
    with pytest.raises(FileNotFoundError):
        checkpoint.load(tmp_path / "agent.npz", like=agent.init(()))


def test_estimators_of_other_packages_are_not_tested_as_ours(tmp_path):
    # Every package that offers one made tests of ours fail.
    (tmp_path / "stranger.py").write_text(ESTIMATOR)
    metadata = tmp_path / "stranger-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    offers = "".join(f"[affinet.{what}]\nstranger = stranger:Own\n" for what in ("estimators", "controllers"))
    (metadata / "entry_points.txt").write_text(offers)
    program = (
        "from affinet.planning.registry import ESTIMATORS, LAWS, names\n"
        "from offered import by_affinet\n"
        "for group, what in ((ESTIMATORS, 'estimators'), (LAWS, 'controllers')):\n"
        "    assert set(names(group)) - by_affinet(what).names == {'stranger'}\n"
    )
    beside = os.pathsep.join([str(tmp_path), str(HELPERS)])
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"PYTHONPATH": beside},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
