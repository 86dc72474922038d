"""What may stand in a broadcast: exactly the fields of its channel, each of its form, of agents that there are."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from netem.core.channels import MEASUREMENT
from netem.core.plain import shown
from netem.wire import values
from netem.wire.arrays import FLOAT, WHOLE, Form, numbers
from netem.wire.wrong import WireError, Wrong

Fields = Mapping[str, Form]


class Payloads:
    """What may stand in the broadcasts of a run.

    Parameters
    ----------
    forms
        What the fields of each channel hold but that of measurements.
    neighbours
        By number of the agent, whom it may have measured.
    dimension
        D.
    foreign
        Agents whose numbers are looked at too, because nobody knows the program that computes them.
    """

    def __init__(
        self,
        forms: Mapping[str, Fields],
        neighbours: Mapping[int, frozenset[int]],
        dimension: int,
        foreign: frozenset[int],
    ) -> None:
        self._forms, self._neighbours, self._dimension, self._foreign = forms, neighbours, dimension, foreign

    def check(self, agent: int, channel: str, payload: Mapping[str, Any]) -> None:
        """See that an agent says on a channel what belongs there.

        Raises
        ------
        WireError
            When it does not: in which field.
        """
        whose = f"agent {agent} on {channel!r}"
        if channel == MEASUREMENT:
            self._check_measurement(agent, whose, payload)
        else:
            _check_fields(whose, payload, self._forms[channel], looking=agent in self._foreign)

    def _check_measurement(self, agent: int, whose: str, payload: Mapping[str, Any]) -> None:
        _refuse_other_names(whose, payload, ("neighbours", "measured"))
        whom, measured = payload["neighbours"], payload["measured"]
        if type(whom) is not list:
            whom = numbers(whom, f"{whose}: 'neighbours'", (-1,), WHOLE).tolist()
        if not ({*map(type, whom)} <= {int} and self._neighbours[agent].issuperset(whom) and len({*whom}) == len(whom)):
            says = f"{whose}: 'neighbours': expected some of {sorted(self._neighbours[agent])}, got {shown(whom)}"
            raise WireError(f"{says} (see docs/protocol.md)", Wrong.SHAPE)
        looking = agent in self._foreign
        if looking or type(measured) is not bytes or len(measured) != len(whom) * self._dimension * FLOAT.itemsize:
            _look(f"{whose}: 'measured'", measured, Form((len(whom), self._dimension), truths=False), looking=looking)


def _check_fields(whose: str, payload: Mapping[str, Any], forms: Fields, *, looking: bool) -> None:
    _refuse_other_names(whose, payload, forms)
    for name, form in forms.items():
        given = payload[name]
        if looking or not form.holds(given):
            _look(f"{whose}: {name!r}", given, form, looking=looking)


def _look(whose: str, given: Any, form: Form, *, looking: bool) -> None:
    array = numbers(given, whose, form.shape, form.dtype)
    if looking:
        values.finite(array, whose)


def _refuse_other_names(whose: str, payload: Mapping[str, Any], names: Collection[str]) -> None:
    if payload.keys() != {*names}:
        says = f"{whose}: expected the fields {', '.join(names)}, got {shown([*payload])}"
        raise WireError(f"{says} (see docs/protocol.md)", Wrong.SHAPE)
