"""Formations from files of graphs: GraphML, or JSON as networkx writes it (node-link)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from affinet.scenario.sections import GraphFields
from analysis.models.arrays import Array
from netem.impairments import measured
from netem.impairments.measured import MeasuredError, shown

_TRUTHS = {"true": True, "1": True, "false": False, "0": False}


class Graph(NamedTuple):
    """Nominal positions (N, D), in metres, edges and leaders, by numbers of agents."""

    nominal: Array
    edges: tuple[tuple[int, int], ...]
    leaders: tuple[int, ...]


class _Said(NamedTuple):
    """Nodes by their names in the file, with their fields, and the ends of edges."""

    nodes: Mapping[str, Mapping[str, Any]]
    edges: Sequence[tuple[str, str]]


def read(file: Path, fields: GraphFields) -> Graph:
    """The formation of a file.

    Nodes that are called 1 to N are the agents of these numbers; others are numbered as they stand in the file.

    Parameters
    ----------
    file
        Which: GraphML where it begins with `<`, or else JSON.
    fields
        What it calls the coordinates, and who leads.

    Raises
    ------
    MeasuredError
        When it is no such file, or says nothing of what a formation needs.
    OSError
        When it cannot be read.
    """
    lines = measured.read(file)
    text = "\n".join(lines.texts)
    said = _graphml(text) if text.lstrip().startswith("<") else _node_link(text, lines.numbers)
    if len(said.nodes) < 2:
        raise MeasuredError("a formation has two nodes at least")
    names = list(said.nodes)
    if set(names) == {str(number) for number in range(1, len(names) + 1)}:
        names.sort(key=int)
    number_of = {name: number for number, name in enumerate(names, start=1)}
    in_space = any(fields.z in said.nodes[name] for name in names)
    axes = (fields.x, fields.y, *([fields.z] if in_space else []))
    nominal = np.array([[_number(name, said.nodes[name], axis) for axis in axes] for name in names])
    leaders = tuple(
        number_of[name] for name in names if _truth(name, said.nodes[name].get(fields.leader, False), fields)
    )
    if not any(fields.leader in node for node in said.nodes.values()):
        raise MeasuredError(
            f"no node says whether it leads, by {fields.leader!r}: add it, or name the field by fields.leader"
        )
    return Graph(nominal, _edges(said.edges, number_of), leaders)


def _edges(said: Iterable[tuple[str, str]], number_of: Mapping[str, int]) -> tuple[tuple[int, int], ...]:
    edges: dict[tuple[int, int], None] = {}
    for source, target in said:
        for name in (source, target):
            if name not in number_of:
                raise MeasuredError(f"an edge {source}-{target} to a node {name!r} that is not there")
        one, other = sorted((number_of[source], number_of[target]))
        if one == other:
            raise MeasuredError(f"an edge from {source} to itself: leave it out")
        edges[one, other] = None
    if not edges:
        raise MeasuredError("there is no edge in it: agents measure along edges")
    return tuple(edges)


def _node_link(text: str, numbers: Sequence[int]) -> _Said:
    try:
        said = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        at = min(getattr(error, "lineno", 1), len(numbers) or 1)
        line = numbers[at - 1] if numbers else 1
        raise MeasuredError(f"line {line}: neither GraphML nor JSON: {getattr(error, 'msg', error)}") from error
    links = said.get("links", said.get("edges")) if isinstance(said, dict) else None
    if not isinstance(said, dict) or not isinstance(said.get("nodes"), list) or not isinstance(links, list):
        raise MeasuredError("no node-link data: an object with lists of nodes, and of links (or edges), is due")
    nodes: dict[str, Mapping[str, Any]] = {}
    for place, node in enumerate(said["nodes"], start=1):
        if not isinstance(node, dict) or "id" not in node:
            raise MeasuredError(f"node {place}: it has no id")
        if str(node["id"]) in nodes:
            raise MeasuredError(f"node {place}: its id {node['id']!r} is another's too")
        nodes[str(node["id"])] = node
    for place, link in enumerate(links, start=1):
        if not isinstance(link, dict) or not {"source", "target"} <= link.keys():
            raise MeasuredError(f"link {place}: it has no source, or no target")
    return _Said(nodes, [(str(link["source"]), str(link["target"])) for link in links])


def _graphml(text: str) -> _Said:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise MeasuredError("a GraphML with a document type: leave it out, GraphML needs none")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise MeasuredError(f"no XML: {error}") from error
    keys = {key.get("id"): key.get("attr.name") for key in _all(root, "key") if key.get("for") in ("node", "all", None)}
    graphs = _all(root, "graph")
    if not graphs:
        raise MeasuredError("no graph in it: GraphML is due")
    nodes: dict[str, Mapping[str, Any]] = {}
    for node in _all(graphs[0], "node"):
        name = node.get("id", "")
        if not name or name in nodes:
            raise MeasuredError(f"a node without an id of its own: {shown(name)}")
        nodes[name] = {str(keys.get(data.get("key"))): (data.text or "").strip() for data in _all(node, "data")}
    return _Said(nodes, [(edge.get("source", ""), edge.get("target", "")) for edge in _all(graphs[0], "edge")])


def _all(element: ElementTree.Element, tag: str) -> list[ElementTree.Element]:
    """What is called so below an element, in whatever namespace."""
    return [one for one in element.iter() if one.tag.rpartition("}")[2] == tag]


def _number(name: str, node: Mapping[str, Any], axis: str) -> float:
    said = node.get(axis)
    try:
        value = float("nan") if isinstance(said, bool) or said is None else float(said)
    except (TypeError, ValueError):
        value = float("nan")
    if not np.isfinite(value):
        has = ", ".join(map(str, node)) or "nothing"
        raise MeasuredError(
            f"node {name}: a number is due for {axis!r}, got {said!r}; it says {has}: fields = {{ x = ... }}"
        )
    return value


def _truth(name: str, said: Any, fields: GraphFields) -> bool:
    if (truth := _TRUTHS.get(str(said).strip().lower())) is None:
        raise MeasuredError(f"node {name}: true or false is due for {fields.leader!r}, got {said!r}")
    return truth
