"""What is wrong is said with what was meant: a key of a table, another word for the same, a percentage."""

import tomllib

import pytest

from affinet.scenario import loading
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError

OF_LOSS = 'network.profiles.mine.loss=[{model="bernoulli",loss=0.3}]'


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("estimator=rkf", "estimator: unknown key; did you mean 'agents.estimator'?"),
        ("duration=3", "duration: unknown key; did you mean 'time.duration'?"),
        ("zones=[]", "zones: unknown key; did you mean 'network.zones'?"),
        (OF_LOSS, "network.profiles.mine.loss.1.loss: unknown key; did you mean 'p'?"),
        ("network.availability=50%", 'should be a number, like 1.0, got "50%"; write 0.5'),
        ("network.availability=2.5 %", 'got "2.5 %"; write 0.025'),
        ("seed=5%", 'got "5%"'),
    ],
)
def test_what_was_meant_is_said(override, says):
    with pytest.raises(ScenarioError) as error:
        loading.load("corridor", [override])
    assert says in str(error.value)
    assert ("; write" in str(error.value)) == ("; write" in says)


def test_a_scenario_is_written_in_rows_and_reads_the_same():
    scenario = loading.load("switching", ['timeline=[{verb="cut",at=1.0,links=["1-2","1-3","2-4"]}]'])
    nodes, edges = [[float(one), -1.5e-9] for one in range(40)], [f"{one}-{one + 1}" for one in range(1, 40)]
    formation = {"nodes": nodes, "edges": edges, "leaders": [1, 2, 3], "weights": [0.123456789012] * 39}
    given = Scenario.model_validate(scenario.model_dump() | {"formation": formation})
    text = loading.to_toml(given)
    assert "\n    [3.0, -1.5e-9],\n" in text.replace("e-09", "e-9")
    assert len(text.splitlines()) < 100
    assert max(len(line) for line in text.splitlines() if "description" not in line) <= 104
    again = tomllib.loads(text)
    assert again["formation"]["nodes"] == nodes
    assert again["formation"]["edges"] == edges
    assert again["timeline"][0]["links"] == ["1-2", "1-3", "2-4"]


@pytest.mark.parametrize("words", ["a, b", "[ \n 1.0,\n]", 'quoted "1.0,\n"'])
def test_text_of_a_user_stays(words):
    given = loading.load("corridor").model_copy(update={"description": words})
    assert tomllib.loads(loading.to_toml(given))["description"] == words
