"""The medium as a process: it is also the run's only Zenoh router (`python -m netem`).

It reads, lets a relay decide, and writes, the journal too.
"""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path

from netem.brief import MediumBrief
from netem.lockstep import LockstepNode
from netem.processes.background import Background
from netem.processes.supervised import Supervisor
from netem.real_time import RealTimeNode
from netem.wire.carrier import Session
from netem.wire.keys import Keys
from netem.wire.repeating import opened
from netem.wire.rights import hub
from netem.wire.session import HUB_ENVIRONMENT, dictionary


def _listening(supervisor: Supervisor, brief: MediumBrief) -> Session:
    agents = range(1, brief.links.agents + 1)
    with dictionary(brief.passwords) as file:
        config = hub(brief.login, file, Keys(brief.run), agents, brief.hosts, brief.trust.largest_message)
        return opened(config, brief.login, supervisor.lost, in_real_time=brief.pace is not None)


def main() -> None:
    """Run the medium until the run is over."""
    os.environ |= HUB_ENVIRONMENT
    supervisor = Supervisor()
    brief = supervisor.brief(MediumBrief)
    with supervisor.confessing(), _listening(supervisor, brief) as session:
        # These take a while to import: everybody else can log in by now.
        from netem.core.arrow import do_without_pandas
        from netem.medium import journal
        from netem.medium.deliveries import Deliveries

        do_without_pandas()
        with (
            journal.Writer(Path(brief.journal), brief.links, brief.channels, brief.batch) as writer,
            ExitStack() as stack,
        ):
            if brief.pace is None:
                node: LockstepNode | RealTimeNode = LockstepNode(session, supervisor, brief, writer)
            else:
                deliveries = Deliveries(Path(brief.journal).parent, brief.links, brief.channels, brief.batch)
                stack.enter_context(deliveries)
                background = stack.enter_context(Background())
                node = RealTimeNode(session, supervisor, brief, writer, deliveries, background)
            node.await_everybody()
            supervisor.tell("ready")
            node.run()
        supervisor.tell("done")
        supervisor.await_order("leave")
