"""hosts.toml: which machines fly a run, who of it is on which, and how a command is started there (docs/machines.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NoReturn

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from affinet.scenario import files
from affinet.scenario.explain import explained, named_in
from affinet.scenario.section import Section
from affinet.scenario.source import Source
from affinet.scenario.wrong import ScenarioError
from netem.wire import endpoints

Agent = Annotated[int, Field(ge=1)]
GONE_AFTER_S = 20.0


class Machine(Section):
    """A machine, and who flies on it: `command` goes before each command there, and is what gets to it.

    With `netem` the medium is there, and listens at this address; `keys` and `affinet` are where they lie there.
    """

    name: str
    command: list[str] = Field(default_factory=list)
    agents: list[Agent] = Field(default_factory=list)
    netem: str | None = None
    keys: str | None = None
    affinet: str = "affinet"


class Hosts(Section):
    """Where the coordinator listens, and the machines; what none of them has is on its own, with the world.

    `medium` is where the medium listens if it is there, `gone_after` how long, in seconds, a machine may be silent.
    """

    scenario: str | None = None
    listen: str
    medium: str | None = None
    keys: str
    gone_after: Annotated[float, Field(ge=1.0, le=3600.0)] = GONE_AFTER_S
    machines: Annotated[list[Machine], Field(min_length=1)]
    _source: Source | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _told_apart(self) -> Hosts:
        named = [f"machine {machine.name}" for machine in self.machines]
        named += [f"agent {agent}" for machine in self.machines for agent in machine.agents]
        if twice := [one for one in named if named.count(one) > 1]:
            raise ValueError(f"{twice[0]} stands there twice")
        if len([machine for machine in self.machines if machine.netem]) > 1:
            raise ValueError("the medium is on one machine: give netem to one of them")
        for endpoint in filter(None, (self.listen, self.medium, *(machine.netem for machine in self.machines))):
            endpoints.over_machines(endpoint)
        return self

    def scenario_from(self, folder: Path) -> str:
        """The scenario it names, seen from its folder.

        Raises
        ------
        ScenarioError
            When it names none.
        """
        if self.scenario is None:
            self._refuse("scenario", "is missing; name one here, or behind the file on the command line")
        return str(folder / self.scenario) if self.scenario.endswith(".toml") else self.scenario

    def refuse_strangers(self, agents: int) -> None:
        """Go on if all of so many agents are meant.

        Raises
        ------
        ScenarioError
            When there is no such agent.
        """
        for number, machine in enumerate(self.machines):
            if strangers := [agent for agent in machine.agents if agent > agents]:
                self._refuse(
                    f"machines[{number}].agents", f"there is no agent {strangers[0]}: the scenario has {agents}"
                )

    def _refuse(self, key: str, says: str) -> NoReturn:
        raise ScenarioError(named_in(self._source or Source("in code", "", ()), [(key, says)]))

    @property
    def medium_listens(self) -> str:
        """Where the medium listens if it is on this machine."""
        return self.medium or beside(self.listen)


def load(path: Path) -> Hosts:
    """The machines in a file.

    Raises
    ------
    ScenarioError
        When there is none, or something in it is wrong.
    """
    file = files.read(str(path), "scenarios", "file of hosts")
    source = Source(file.name, file.text, ())
    try:
        hosts = Hosts.model_validate(file.says)
    except ValidationError as error:
        raise ScenarioError(explained(error, Hosts, source)) from None
    hosts._source = source
    return hosts


def beside(endpoint: str) -> str:
    """The endpoint at the next port."""
    address, _, port = endpoint.rpartition(":")
    return f"{address}:{int(port) + 1}"
