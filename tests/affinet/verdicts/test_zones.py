"""What a jammed zone took hold of, and why it took hold of nothing: then the run is vacuous, and is no pass."""

import re

import numpy as np
import pytest
from flying import plan_of
from scripted import timeline

from affinet.runtimes.rehearsing import rehearse
from affinet.verdicts.zones import jams
from netem.medium.verdict import Verdict

SHORT = ("time.dt=0.05", "time.duration=3", "network.availability=1")


def flown(zones, *more):
    return rehearse(plan_of("corridor", *SHORT, f"network.zones={zones}", *more))


def test_what_zones_jam_is_what_is_booked_as_jammed():
    run = flown("[{centre=[0,0],radius=2.0,share=0.5},{centre=[30,0],radius=1.0}]")
    first, second = run.outcome.zones
    assert first.jammed == run.outcome.messages["dropped"]["jammed"] > 0
    assert (first.why, second.jammed) == (None, 0)
    assert str(first) == f"1, 2 m about (0, 0) jammed {first.jammed} messages"
    assert run.outcome.to_json()["zones"][0] == {"zone": "1, 2 m about (0, 0)", "jammed": first.jammed, "why": None}
    assert run.outcome.verdict == "vacuous"  # by the second


def test_each_counts_what_is_jammed_within_it_on_its_links_and_channels():
    given = "[{centre=[0,0],radius=9.0,links='4->all',channels='comms'},{centre=[0,0],radius=9.0,links='all->5'}]"
    run = flown(given, "network.coupled=false")
    links, jammed = run.plan.world.links, run.arrays["verdicts"] == Verdict.JAMMED
    from_4, to_5 = links.src == 4, links.dst == 5
    assert not jammed[:, 0, from_4 & ~to_5].any()
    assert [zone.jammed for zone in run.outcome.zones] == [jammed[:, 1:, from_4].sum(), jammed[:, :, to_5].sum()]


def test_one_that_nobody_enters_makes_the_run_vacuous_and_says_who_came_nearest():
    run = flown("[{centre=[20.0,5.0],radius=1.5}]")
    assert run.outcome.verdict == "vacuous"
    (reason,) = run.outcome.reasons
    said = re.fullmatch(
        r"zone 1, 1\.5 m about \(20, 5\) jammed no message and proved nothing: nobody who hears on its links was ever in it; "
        r"agent (\d) came nearest, to ([\d.]+) m of its centre at ([\d.]+) s",
        reason,
    )
    apart = np.linalg.norm(run.position - [20.0, 5.0], axis=-1)
    tick, agent = np.unravel_index(apart.argmin(), apart.shape)
    assert (int(said[1]), float(said[2])) == (agent + 1, pytest.approx(apart.min(), rel=1e-2))
    assert float(said[3]) == pytest.approx(tick * run.dt)


@pytest.mark.parametrize(
    ("zones", "more", "why"),
    [
        ("[{centre=[0,0],radius=9.0,share=0.0}]", (), "its share of ticks is 0"),
        (
            "[{centre=[0,0],radius=9.0,links='4-6',share=0.9}]",
            (timeline({"verb": "cut", "at": 0.0, "links": ["4-6"]}),),
            "what it would have jammed was silent, or dropped for a stronger reason (docs/network.md), and it is on in a "
            "share of 0.9 of the ticks",
        ),
    ],
)
def test_one_that_is_off_or_too_late_says_so(zones, more, why):
    run = flown(zones, *more)
    assert [zone.why for zone in run.outcome.zones] == [why]
    assert run.outcome.verdict == "vacuous"


def test_of_a_run_without_a_tick_nothing_is_near():
    run = flown("[{centre=[0,0],radius=9.0}]")
    none = {name: array[:0] for name, array in run.arrays.items()}
    (zone,) = jams(run.plan, none)
    assert zone.jammed == 0
    assert zone.why == "no tick was flown"
