"""An agent hears a peer only through the medium, speaks only as itself, and needs nothing of ours to do so."""

import json
import socket
import sys
from datetime import timedelta

from flying import PROCESSES, digest_of, plan_of
from paths import PROGRAMS

from affinet.runtimes.launcher import Launcher
from netem.wire import authority
from netem.wire.carrier import NotCarried, Session
from netem.wire.session import HUB, Login, client, clients
from world.books import history

pytestmark = PROCESSES


class Watched(Launcher):
    """Keeps everybody's logins where the test finds them, and makes them anew with `login`."""

    login = staticmethod(lambda login: login)

    def _make_logins(self, private):
        self.logins = {name: self.login(made) for name, made in super()._make_logins(private).items()}
        return self.logins


def fly(plan, out, **programs):
    out.mkdir()
    commands = {int(agent.removeprefix("agent_")): command for agent, command in programs.items()}
    flight = Launcher(plan, out, watch=lambda *_: None, programs=commands).fly()
    assert flight.failure is None, flight.failure
    assert flight.uninstructed == 0
    return history.load(out / history.ARRAYS)


def test_a_rogue_gets_nothing_through(out, tmp_path, monkeypatch):
    monkeypatch.setenv("RUST_LOG", "zenoh::net::routing::interceptor::access_control=trace")
    cut_off = (
        *("time.dt=0.02", "time.duration=0.6", "agents.parameters.static.alpha=2", 'agents.estimator="crkf"'),
        'timeline=[{verb="cut",at=0.0,links=["5"]}]',
    )
    report = tmp_path / "report.json"
    rogue = [sys.executable, str(PROGRAMS / "rogue_agent.py"), str(report)]
    arrays = fly(plan_of("rigid", *cut_off), out, agent_5=rogue)
    told = json.loads(report.read_text())
    assert told["lies"] == 9 * 5 * 20
    assert told["heard"] == ["agent/5/rx", "agent/5/told"]
    # All that can be known of what is refused before anybody of ours sees it; some is lost in the queue of who says it.
    lines = (out / "logs" / "netem.log").read_text().splitlines()
    refused = [line for line in lines if "Username(agent-5)" in line and "is unauthorized to Put (ingress)" in line]
    assert refused
    assert history.digest(arrays) == digest_of("rigid", *cut_off)


def test_a_wrong_password_is_refused(out):
    plan = plan_of("corridor", "time.duration=2")
    refused = []

    def intrude(_tick, _error):
        if not refused:
            try:
                # Whose session is not open: another of one that is would be refused for that.
                with Session(client(Login(launcher.logins["control"].endpoint, "control", "guess"), patience_s=2.0)):
                    pass
                refused.append(False)
            except NotCarried:
                refused.append(True)

    out.mkdir()
    launcher = Watched(plan, out, watch=intrude)
    launcher.fly()
    assert refused == [True]


def test_a_second_session_of_a_login_ends_the_run(out):
    intruding = []

    def intrude(_tick, _error):
        if not intruding:
            intruding.append(Session(client(launcher.logins["agent-1"], patience_s=5.0) | {"id": "5ec0d"}))

    out.mkdir()
    launcher = Watched(plan_of("corridor", "time.duration=20"), out, watch=intrude)
    flight = launcher.fly()
    intruding[0].__exit__(None, None, None)
    assert flight.failure == (
        "netem: StrangerEntered: somebody who has a password of this run opened a session called 5ec0d: "
        "a process has one, called by the id of its login (docs/protocol.md)"
    )


def test_over_tls_a_swarm_flies_the_same_bits(out, tmp_path):
    plan = plan_of("corridor", "time.duration=2")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        endpoint = f"tls/127.0.0.1:{taken.getsockname()[1]}"
    names = [HUB, *clients(range(1, 8), {})]
    authority.make(tmp_path / "keys", names, [], timedelta(days=1))
    out.mkdir()
    launcher = Watched(plan, out, watch=lambda *_: None)
    launcher.login = lambda login: Login(endpoint, login.name, keys=str(tmp_path / "keys"))
    flight = launcher.fly()
    assert flight.failure is None
    assert history.digest(history.load(out / history.ARRAYS)) == digest_of("corridor", "time.duration=2")
