"""An agent hears a peer only through the medium, speaks only as itself, and needs nothing of ours to do so."""

import json
import sys

from flying import PROCESSES, digest_of, plan_of
from paths import PROGRAMS

from affinet.runtimes.launcher import Launcher
from world.books import history

pytestmark = PROCESSES


def fly(plan, out, **programs):
    out.mkdir()
    commands = {int(agent.removeprefix("agent_")): command for agent, command in programs.items()}
    flight = Launcher(plan, out, watch=lambda *_: None, programs=commands).fly()
    assert flight.failure is None, flight.failure
    assert flight.uninstructed == 0
    return history.load(out / "arrays.npz")


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
    from netem.wire.carrier import NotCarried, Session
    from netem.wire.session import Login, client

    plan = plan_of("corridor", "time.duration=2")
    refused = []

    class Intruding(Launcher):
        def _make_logins(self, private):
            logins = super()._make_logins(private)
            self.endpoint = logins["netem"].endpoint
            return logins

    def intrude(_tick, _error):
        if not refused:
            try:
                with Session(client(Login(launcher.endpoint, "agent-1", "guess"), patience_s=2.0)):
                    pass
                refused.append(False)
            except NotCarried:
                refused.append(True)

    out.mkdir()
    launcher = Intruding(plan, out, watch=intrude)
    launcher.fly()
    assert refused == [True]


def test_a_foreign_agent_flies_with_zenoh_and_messagepack_alone(out):
    plan = plan_of("corridor", "time.duration=2", 'agents.estimator="none"')
    foreign = [sys.executable, str(PROGRAMS / "foreign_agent.py")]
    arrays = fly(plan, out, agent_6=foreign)
    assert (arrays["input"][:, 5] == 0.0).all()
    assert (arrays["position"][0, 5] == arrays["position"][-1, 5]).all()
    assert (arrays["input"][1:, 4] != 0.0).all()
