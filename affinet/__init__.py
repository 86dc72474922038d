"""affinet: a scenario in, a run out.

All that a program, a test, or a user's own estimator, law or checker needs is here (docs/library.md), and is imported when it
is asked for: `import affinet` takes no time, and an agent that asks for `Estimate` does not load the application.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from affinet import scenario as scenario
    from affinet.library import journal as journal
    from affinet.library import load as load
    from affinet.library import realised as realised
    from affinet.library import run as run
    from affinet.planning.plan import PlanError as PlanError
    from affinet.scenario.sections import Scenario as Scenario
    from affinet.scenario.wrong import ScenarioError as ScenarioError
    from affinet.testing import strategies as strategies
    from affinet.testing.many import FlownSeeds as FlownSeeds
    from affinet.testing.many import OverSeeds as OverSeeds
    from affinet.verdicts.checkers import agreement as agreement
    from affinet.verdicts.checkers import below as below
    from affinet.verdicts.checkers import bounded as bounded
    from affinet.verdicts.checkers import collision_free as collision_free
    from affinet.verdicts.checkers import consistent as consistent
    from affinet.verdicts.checkers import converged as converged
    from affinet.verdicts.checkers import energy as energy
    from affinet.verdicts.checkers import localized as localized
    from affinet.verdicts.checkers import never_heard_across_a_cut as never_heard_across_a_cut
    from affinet.verdicts.checkers import recovers as recovers
    from affinet.verdicts.checkers import smooth as smooth
    from affinet.verdicts.checking import Checker as Checker
    from affinet.verdicts.checking import CheckResult as CheckResult
    from affinet.verdicts.evidence import Evidence as Evidence
    from affinet.verdicts.flown import Broken as Broken
    from affinet.verdicts.flown import FlownRun as FlownRun
    from affinet.verdicts.pursued import agreed as agreed
    from affinet.verdicts.pursued import found as found
    from affinet.verdicts.quantities import Quantity as Quantity
    from affinet.verdicts.quantities import quantity as quantity
    from affinet.verdicts.signals import Signal as Signal
    from affinet.verdicts.temporal import always as always
    from affinet.verdicts.temporal import eventually as eventually
    from affinet.verdicts.temporal import until as until
    from agents.brief import Brief as Brief
    from agents.brief import Gap as Gap
    from agents.brief import Own as Own
    from agents.brief import Reading as Reading
    from agents.estimate import Estimate as Estimate
    from agents.estimate import no_edges as no_edges
    from agents.estimate import no_indicator as no_indicator
    from agents.estimators.base import Centre as Centre
    from agents.estimators.base import CentreEstimate as CentreEstimate
    from agents.estimators.base import Estimator as Estimator
    from agents.estimators.centralized import SwarmFilter as SwarmFilter
    from agents.exchange import Channels as Channels
    from agents.exchange import Field as Field
    from agents.exchange import Fields as Fields
    from agents.exchange import Heard as Heard
    from agents.laws.base import Law as Law
    from agents.laws.base import Nothing as Nothing
    from agents.laws.base import stress_force as stress_force
    from agents.swarm import SwarmBrief as SwarmBrief
    from agents.wants import Wants as Wants
    from analysis.models import algebra as algebra
    from analysis.models import elementary as elementary
    from analysis.models.arrays import Array as Array
    from analysis.models.arrays import Integers as Integers
    from analysis.models.arrays import Mask as Mask
    from analysis.models.finding import Finding as Finding
    from analysis.models.unsuited import Unsuited as Unsuited
    from netem.impairments.own import Loss as Loss
    from netem.impairments.own import Offered as Offered
    from netem.processes.user_code import UserCodeError as UserCodeError
    from world.books.history import Damaged as Damaged

    __version__: str

# Those of each module above, by the room it is in; of a name that stands alone the module itself.
_NAMES: dict[tuple[str, str], tuple[str, ...]] = {
    ("affinet", "library"): ("journal", "load", "realised", "run"),
    ("affinet", "planning.plan"): ("PlanError",),
    ("affinet", "scenario.sections"): ("Scenario",),
    ("affinet", "scenario.wrong"): ("ScenarioError",),
    ("affinet", "testing.many"): ("FlownSeeds", "OverSeeds"),
    ("affinet", "verdicts.checkers"): (
        *("agreement", "below", "bounded", "collision_free", "consistent", "converged", "energy"),
        *("localized", "never_heard_across_a_cut", "recovers", "smooth"),
    ),
    ("affinet", "verdicts.quantities"): ("Quantity", "quantity"),
    ("affinet", "verdicts.signals"): ("Signal",),
    ("affinet", "verdicts.temporal"): ("always", "eventually", "until"),
    ("affinet", "verdicts.pursued"): ("agreed", "found"),
    ("affinet", "verdicts.checking"): ("Checker", "CheckResult"),
    ("affinet", "verdicts.evidence"): ("Evidence",),
    ("affinet", "verdicts.flown"): ("Broken", "FlownRun"),
    ("agents", "brief"): ("Brief", "Gap", "Own", "Reading"),
    ("agents", "estimate"): ("Estimate", "no_edges", "no_indicator"),
    ("agents", "estimators.base"): ("Centre", "CentreEstimate", "Estimator"),
    ("agents", "estimators.centralized"): ("SwarmFilter",),
    ("agents", "exchange"): ("Channels", "Field", "Fields", "Heard"),
    ("agents", "laws.base"): ("Law", "Nothing", "stress_force"),
    ("agents", "swarm"): ("SwarmBrief",),
    ("agents", "wants"): ("Wants",),
    ("analysis", "models.arrays"): ("Array", "Integers", "Mask"),
    ("analysis", "models.finding"): ("Finding",),
    ("analysis", "models.unsuited"): ("Unsuited",),
    ("netem", "impairments.own"): ("Loss", "Offered"),
    ("netem", "processes.user_code"): ("UserCodeError",),
    ("world", "books.history"): ("Damaged",),
}
_MODULES = {
    "algebra": ("analysis", "models.algebra"),
    "elementary": ("analysis", "models.elementary"),
    "scenario": ("affinet", "scenario"),
    "strategies": ("affinet", "testing.strategies"),
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}

__all__ = sorted([*_MODULE_OF, *_MODULES, "__version__"])

# BLAS rounds otherwise when it shares large matrices out to threads, and agents' processes have one each. It looks at this when
# NumPy is imported.
os.environ["OPENBLAS_NUM_THREADS"] = "1"


def _looked_up(name: str) -> Any:
    __tracebackhide__ = True
    if name not in __all__:
        raise AttributeError(f"module 'affinet' has no attribute {name!r}")
    globals()[name] = found = _imported(name)
    return found


def _imported(name: str) -> Any:
    __tracebackhide__ = True
    if name == "__version__":
        from importlib.metadata import version

        return version("affinet")
    from affinet import rooms

    rooms.refuse_shadows()
    if name in _MODULES:
        return import_module(rooms.module(*_MODULES[name]))
    return getattr(import_module(rooms.module(*_MODULE_OF[name])), name)


def __dir__() -> list[str]:
    return list(__all__)


if not TYPE_CHECKING:
    __getattr__ = _looked_up  # type checkers would take any name for one that is there
