"""Formations from GraphML and from node-link JSON."""

import json

import pytest
from flying import plan_of

from affinet.planning import graphs
from affinet.scenario.sections import GraphFields
from affinet.scenario.wrong import ScenarioError
from netem.impairments.measured import MeasuredError

GRAPHML = """<?xml version='1.0' encoding='utf-8'?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
  <key id="d0" for="node" attr.name="x" attr.type="double"/>
  <key id="d1" for="node" attr.name="y" attr.type="double"/>
  <key id="d2" for="node" attr.name="leader" attr.type="boolean"/>
  <key id="d3" for="edge" attr.name="x" attr.type="double"/>
  <graph edgedefault="undirected">
    <node id="b"><data key="d0">0</data><data key="d1">1.5</data><data key="d2">true</data></node>
    <node id="a"><data key="d0">2.0</data><data key="d1">-1</data></node>
    <node id="c"><data key="d0">3</data><data key="d1">4</data><data key="d2">False</data></node>
    <edge source="b" target="a"><data key="d3">7</data></edge>
    <edge source="c" target="b"/>
    <edge source="b" target="c"/>
  </graph>
</graphml>
"""


def node_link(nodes, links, **more):
    return json.dumps(
        {"directed": False, "multigraph": False, "graph": {}, "nodes": nodes, "links": links} | more, indent=1
    )


def node(name, x, y, **more):
    return {"id": name, "x": x, "y": y} | more


TRIANGLE = [node(0, 0.0, 0.0, leader=True), node(1, 1.0, 0.0, leader=1), node(2, 0.0, 1.0)]
AROUND = [{"source": 0, "target": 1}, {"source": 1, "target": 2}, {"source": 2, "target": 0}]


@pytest.fixture
def read(tmp_path):
    def of(text, **fields):
        (tmp_path / "swarm.txt").write_text(text)
        return graphs.read(tmp_path / "swarm.txt", GraphFields(**fields))

    return of


def test_graphml(read):
    found = read(GRAPHML)
    assert found.nominal.tolist() == [[0.0, 1.5], [2.0, -1.0], [3.0, 4.0]]  # as they stand in the file
    assert found.edges == ((1, 2), (1, 3))
    assert found.leaders == (1,)


def test_node_link_of_either_networkx(read):
    for text in (node_link(TRIANGLE, AROUND), node_link(TRIANGLE, AROUND).replace('"links"', '"edges"')):
        found = read(text)
        assert found.nominal.tolist() == [[0, 0], [1, 0], [0, 1]]
        assert (found.edges, found.leaders) == (((1, 2), (2, 3), (1, 3)), (1, 2))


def test_nodes_called_by_numbers_of_agents_are_these(read):
    turned = [{**one, "id": 3 - one["id"]} for one in TRIANGLE]
    links = [{"source": 3, "target": 2}, {"source": 2, "target": 1}]
    found = read(node_link(turned, links))
    assert found.nominal.tolist() == [[0, 1], [1, 0], [0, 0]]
    assert (found.edges, found.leaders) == (((2, 3), (1, 2)), (2, 3))


def test_fields_by_other_names_and_in_space(read):
    nodes = [{"id": n, "px": n, "py": 0.5, "h": -n, "anchor": n < 1} for n in range(3)]
    found = read(node_link(nodes, AROUND), x="px", y="py", z="h", leader="anchor")
    assert found.nominal.tolist() == [[0, 0.5, 0], [1, 0.5, -1], [2, 0.5, -2]]
    assert found.leaders == (1,)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "neither GraphML nor JSON"),
        ('{"nodes": [\n}', "line 2: neither GraphML nor JSON"),
        ("[1]", "no node-link data: an object with lists of nodes, and of links"),
        (node_link([{"x": 1}], AROUND), "node 1: it has no id"),
        (node_link([*TRIANGLE, node(0, 1, 1)], AROUND), "node 4: its id 0 is another's too"),
        (node_link(TRIANGLE, [{"source": 0}]), "link 1: it has no source, or no target"),
        (node_link(TRIANGLE, [{"source": 0, "target": 9}]), "an edge 0-9 to a node '9' that is not there"),
        (node_link(TRIANGLE, [{"source": 0, "target": 0}]), "an edge from 0 to itself"),
        (node_link(TRIANGLE, []), "there is no edge in it"),
        (
            node_link([*TRIANGLE, node(3, "far", 1)], AROUND),
            "node 3: a number is due for 'x', got 'far'; it says id, x, y",
        ),
        (node_link([*TRIANGLE, node(3, 1, 1, leader="maybe")], AROUND), "node 3: true or false is due for 'leader'"),
        (node_link([node(0, 0, 0), node(1, 1, 1)], AROUND[:1]), "no node says whether it leads, by 'leader'"),
        (node_link(TRIANGLE[:1], []), "two nodes at least"),
        (GRAPHML.replace("</graphml>", ""), "no XML: no element found: line"),
        (GRAPHML.replace("graph ", "tree ").replace("</graph>", "</tree>"), "no graph in it: GraphML is due"),
        (GRAPHML.replace('id="a"', 'id="b"'), "a node without an id of its own: 'b'"),
        (GRAPHML.replace('<data key="d1">-1</data>', ""), "node a: a number is due for 'y', got None"),
        (GRAPHML.replace("<graphml", "<!DOCTYPE graphml><graphml"), "a GraphML with a document type: leave it out"),
    ],
)
def test_what_is_malformed_says_where(text, says, read):
    with pytest.raises(MeasuredError, match=says) as caught:
        read(text)
    assert "\n" not in str(caught.value)


def test_a_scenario_flies_a_file_of_a_formation(tmp_path):
    made = plan_of("corridor", "time.dt=0.05", "time.duration=0.5")
    nominal, leaders = made.world.formation.nominal / 2.0, made.world.formation.leaders
    nodes = [node(n, *row, leader=n in leaders) for n, row in enumerate(nominal.tolist(), start=1)]
    links = [{"source": one, "target": other} for one, other in made.world.formation.edges]
    (tmp_path / "swarm.json").write_text(node_link(nodes, links))
    again = plan_of(
        "corridor", f'formation={{file="{tmp_path}/swarm.json",scale=2.0}}', "time.dt=0.05", "time.duration=0.5"
    )
    assert again.world.formation.nominal.tolist() == made.world.formation.nominal.tolist()
    assert (again.world.formation.edges, again.world.formation.leaders) == (made.world.formation.edges, leaders)
    with pytest.raises(ScenarioError, match=r"formation.file: .*none.json: no such file"):
        plan_of("corridor", 'formation={file="none.json"}')
