"""What may stand in a broadcast: exactly the fields of its channel, each of its form, of agents that there are."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from netem.core.channels import MEASUREMENT
from netem.core.plain import shown
from netem.wire import values
from netem.wire.arrays import FLOAT, WHOLE, Form, numbers
from netem.wire.wrong import WireError, Wrong


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
        forms: Mapping[str, Mapping[str, Form]],
        neighbours: Mapping[int, frozenset[int]],
        dimension: int,
        foreign: frozenset[int],
    ) -> None:
        self._forms, self._neighbours, self._dimension, self._foreign = forms, neighbours, dimension, foreign
        self._place = dimension * FLOAT.itemsize

    def check(self, agent: int, channel: str, payload: Mapping[str, Any]) -> None:
        """See that an agent says on a channel what belongs there.

        Raises
        ------
        WireError
            When it does not: in which field.
        """
        if agent in self._foreign or not self._fits(agent, channel, payload):
            self._look(agent, channel, payload)

    def _fits(self, agent: int, channel: str, payload: Mapping[str, Any]) -> bool:
        """Whether it is as agents of ours say it, which is seen at once."""
        if channel != MEASUREMENT:
            forms = self._forms[channel]
            return payload.keys() == forms.keys() and all(form.holds(payload[name]) for name, form in forms.items())
        if len(payload) != 2:
            return False
        whom, measured = payload.get("neighbours"), payload.get("measured")
        return (
            type(whom) is list
            and self._are_neighbours(agent, whom)
            and type(measured) is bytes
            and len(measured) == len(whom) * self._place
        )

    def _are_neighbours(self, agent: int, whom: list[Any]) -> bool:
        numbered = all(type(one) is int for one in whom)
        return numbered and self._neighbours[agent].issuperset(whom) and len({*whom}) == len(whom)

    def _look(self, agent: int, channel: str, payload: Mapping[str, Any]) -> None:
        whose, forms = f"agent {agent} on {channel!r}", self._forms.get(channel, {})
        if channel == MEASUREMENT:
            _refuse_other_names(whose, payload, ("neighbours", "measured"))
            forms = {
                "measured": Form((self._measured(agent, whose, payload["neighbours"]), self._dimension), truths=False)
            }
        else:
            _refuse_other_names(whose, payload, forms)
        for name, form in forms.items():
            array = numbers(payload[name], f"{whose}: {name!r}", form.shape, form.dtype)
            if agent in self._foreign:
                values.finite(array, f"{whose}: {name!r}")

    def _measured(self, agent: int, whose: str, said: Any) -> int:
        """How many neighbours it has measured."""
        whom = said if type(said) is list else numbers(said, f"{whose}: 'neighbours'", (-1,), WHOLE).tolist()
        if not self._are_neighbours(agent, whom):
            says = f"{whose}: 'neighbours': expected some of {sorted(self._neighbours[agent])}, got {shown(whom)}"
            raise WireError(f"{says} (see docs/protocol.md)", Wrong.SHAPE)
        return len(whom)


def _refuse_other_names(whose: str, payload: Mapping[str, Any], names: Collection[str]) -> None:
    if payload.keys() != {*names}:
        says = f"{whose}: expected the fields {', '.join(names)}, got {shown([*payload])}"
        raise WireError(f"{says} (see docs/protocol.md)", Wrong.SHAPE)
