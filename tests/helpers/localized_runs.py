"""Runs in which agents localize themselves, flown in this process."""

from functools import cache

from flying import plan_of

from affinet.runtimes.rehearsing import rehearse
from world.books.localized import FirstMeasurements

NAME = "localization"


FOUR = (
    "formation.nodes=[[0,0],[3,1],[1,4],[4,5]]",
    'formation.edges=["1-2","1-3","2-3","2-4","3-4"]',
    "formation.leaders=[3]",
)


@cache
def flown(*overrides):
    return rehearse(plan_of(NAME, *overrides))


def known(run):
    world, arrays = run.plan.world, run.arrays
    return FirstMeasurements.of(world, run.timeline, arrays["measured"], arrays["verdicts"][:, 0]).edges()


ROW = (
    "formation.nodes=[[0,0],[1,0],[2,0],[3,0],[4,0],[5,0]]",
    'formation.edges=["1-2","2-3","3-4","4-5","5-6"]',
)
