"""Pursuits as overrides of the scenario of a target."""

import pytest
from flying import plan_of

from affinet.planning.plan import PlanError
from affinet.scenario.bodies import INTEGRATORS
from affinet.scenario.wrong import ScenarioError

NAME = "target"
COARSE = ("time.dt=0.01", "target.latencies=[0.2,0.1]", "agents.parameters.target.theta=4")
ALONE = 'agents.parameters.target={fusion="none"}'


def bodies(order, *kappa):
    """Bodies of an order, and the gains of the law that steers them."""
    return f'dynamics.model="{INTEGRATORS[order - 1]}"', f"agents.parameters.pursuit.kappa={list(map(float, kappa))}"


SINGLE = bodies(1, 1)
TRIPLE = (*bodies(3, 27, 27, 9), "target.order=3")  # thrice a pole at -3/s
FEW = "formation={nodes=[[5,0],[-3,4],[-3,-4]],edges=['1-2','2-3'],leaders=[],spread=3.0}"


def refusal(*overrides, name=NAME):
    with pytest.raises((ScenarioError, PlanError)) as told:
        plan_of(name, *overrides)
    said = str(told.value)
    assert "\n" not in said
    return said
