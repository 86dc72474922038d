"""What an agent's messages are made of, and what they say of itself."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

import numpy as np

from affinet.conformance import flights
from affinet.conformance.case import Case, NotApplicable
from affinet.conformance.record import ACT, Answer, Asked, Record
from agents.arrivals import forms_of
from agents.brief import DERIVATIVES
from analysis.models.arrays import Array
from netem.core.channels import INPUT, MEASUREMENT
from netem.core.plain import shown
from netem.wire import messages
from netem.wire.arrays import channel_rows, numbers
from netem.wire.keys import Keys
from netem.wire.wrong import WireError
from world.acts import Acts

_BRIEF, _SENSE, _EXCHANGE = (f"An agent's life, {step}" for step in ("1. Brief", "3. Sense", "4. Exchange"))
_ROUNDING = 1e-9


def broadcasts(record: Record) -> Iterator[str]:
    """Broadcasts that are none, or do not hold what their channel promises."""
    forms = forms_of(record.plan.agents.channels())
    dimension = record.plan.world.formation.dimension
    for asked, stream, said in record.answers:
        if stream not in record.channels:
            continue
        try:
            payload = messages.unpack_relayed(said.data).payload
            if stream == MEASUREMENT:
                rows = numbers(payload.get("measured"), "'measured'", (-1, dimension))
                numbers(payload.get("neighbours"), "'neighbours'", (len(rows),), np.dtype("<i8"))
            else:
                channel_rows(forms[stream], [payload], [f"agent {record.agent}"])
        except WireError as error:
            yield f"{asked}: on {stream!r}: {error}"


def acts(record: Record) -> Iterator[str]:
    """Acts that are none, or do not hold what is promised."""
    world = record.plan.world
    reader = Acts(Keys("conformance"), world.links, world.formation.dimension, record.plan.reports)
    for asked, _, said in of_stream(record, ACT):
        try:
            done = reader.together({record.agent: messages.unpack(messages.Act, said.data)})
        except WireError as error:
            yield f"{asked}: {error}"
            continue
        if not np.isfinite(done.input).all():
            yield f"{asked}: input = {done.input[record.agent - 1].tolist()}, which is not finite"


def miscounted(record: Record) -> Iterator[tuple[Asked, str]]:
    """Acts whose process has not heard as much as they say."""
    for _, of_life in groupby(of_stream(record, ACT), key=lambda answer: answer.asked.life):
        heard, last = 0, None
        for asked, _, said in of_life:
            if asked is not last:
                heard, last = heard + len(asked.handed), asked
            if said.fields.get("heard") != heard:
                yield asked, f"{asked}: heard = {shown(said.fields.get('heard'))}, where {heard} had come"


def told_input(record: Record, life: int) -> Iterator[tuple[Asked, str]]:
    """Where one of its processes tells another input than flies."""
    name = DERIVATIVES[record.plan.agents.law.order - 1]
    for asked, _, said in of_stream(record, INPUT):
        if asked.life != life or asked.flying is None:
            continue
        payload = said.fields.get("payload")
        try:
            told = numbers(payload.get(name) if isinstance(payload, dict) else None, name, asked.flying.shape)
        except WireError:  # a matter of forms
            continue
        if told.tolist() != asked.flying.tolist():
            yield asked, f"{asked}: {name} = {told.tolist()}, where {asked.flying.tolist()} flies"


def of_stream(record: Record, stream: str) -> list[Answer]:
    """What it published on one."""
    return [answer for answer in record.answers if answer.stream == stream]


def inputs(record: Record) -> Iterator[tuple[Asked, Array]]:
    """What it steers, as far as that can be read."""
    for asked, _, said in of_stream(record, ACT):
        try:
            yield asked, numbers(said.fields.get("input"), "input", (record.plan.world.formation.dimension,))
        except WireError:  # a matter of forms
            continue


def _counts(record: Record) -> Iterator[str]:
    return (said for _, said in miscounted(record))


def _flies(record: Record) -> Iterator[str]:
    return (said for _, said in told_input(record, 0))


def _limited(record: Record) -> Iterator[str]:
    limit, steered = record.plan.scenario.agents.limit, list(inputs(record))
    assert limit is not None
    if not record.stopped and not any(input_.any() for _, input_ in steered):
        raise NotApplicable("it steered nowhere")
    for asked, input_ in steered:
        if (length := float(np.linalg.norm(input_))) > limit * (1.0 + _ROUNDING):
            yield f"{asked}: its input is {length:.6g} long, where `limit` is {limit:g}"


CASES = (
    Case("broadcast-forms", "broadcast what each channel promises, in the shapes", _SENSE, flights.PLAIN, broadcasts),
    Case(
        "act-forms",
        "act with the fields and shapes that are promised; its input is finite",
        _EXCHANGE,
        flights.PLAIN,
        acts,
    ),
    Case("heard", "count in `heard` all broadcasts it received", _EXCHANGE, flights.PLAIN, _counts),
    Case("input", "tell on `input` the input that flies: that of its last act", _SENSE, flights.PLAIN, _flies),
    Case("limit", "command no input longer than `limit`", _BRIEF, flights.LIMITED, _limited),
)
