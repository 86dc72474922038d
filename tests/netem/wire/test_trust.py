"""The threat model of docs/trust.md, line by line: each attack fails, and gets through once its protection is taken away."""

import json
import os
import socket
import tempfile
import threading
from contextlib import ExitStack, contextmanager, suppress
from datetime import timedelta
from pathlib import Path

import pytest
import zenoh

from netem.wire import authority
from netem.wire import session as session_config
from netem.wire.carrier import Session, StrangerEntered
from netem.wire.keys import Keys
from netem.wire.rights import hub
from netem.wire.session import (
    CENTRE,
    CONTROL,
    DRIVER,
    HUB,
    LARGEST,
    WORLD,
    Login,
    agent_name,
    client,
    dictionary,
    identity,
)

KEYS = Keys("now")
AGENTS = (1, 2)
OWN = KEYS.broadcast(2, "input")
NAMES = (HUB, WORLD, CENTRE, CONTROL, DRIVER, *map(agent_name, AGENTS))
SOON = 0.7
ROOM = 4096
BLOCK = zenoh.CongestionControl.BLOCK

both = pytest.mark.parametrize("protected", [True, False], ids=["protected", "without"])


class Star:
    """A hub, and whoever connects to it; a protection is taken away by changing what Zenoh is told."""

    def __init__(self, folder, proof):
        self._stack, self._proof = ExitStack(), proof
        self._keys = str(folder / "keys") if proof == "certificates" else None
        if self._keys:
            authority.make(Path(self._keys), NAMES, [], timedelta(days=1))
            self.endpoint = f"tls/127.0.0.1:{free_port()}"
        else:
            self.endpoint = f"tcp/127.0.0.1:{free_port()}"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._stack.close()

    def login(self, name, **other):
        secret = {"keys": self._keys} if self._keys else {"password": f"of {name}"}
        return Login(**({"endpoint": self.endpoint, "name": name} | secret | other))

    def open(self, config):
        return self._stack.enter_context(zenoh.open(zenoh.Config.from_json5(json.dumps(config))))

    def listen(self, change=None):
        with dictionary({} if self._keys else {name: f"of {name}" for name in NAMES}) as file:
            config = hub(self.login(HUB), file, KEYS, AGENTS, {})
            if change:
                change(config)
            self.hub = self.open(config)
        self.everything = self.hub.declare_subscriber("affinet/**", zenoh.handlers.FifoChannel(ROOM))
        # An agent learns of these alone, and so knows when it is heard.
        self._ears = [
            self.hub.declare_subscriber(key, zenoh.handlers.RingChannel(1))
            for key in (KEYS.broadcast("*", "*"), KEYS.sense, KEYS.measured("*"))
        ]
        return self

    def join(self, name, **changes):
        return self.open(client(self.login(name), SOON) | changes)

    def is_let_in(self, config):
        try:
            self.open(config)
        except zenoh.ZError:
            return False
        return True

    def gets_through(self, session, say, own=OWN):
        """Whether what is said arrives at the hub, in any form, before what is said rightly after it, on a key of one's own."""
        awaited(session.declare_publisher(own))
        say(session)
        session.put(own, b"rightly", congestion_control=BLOCK)
        return arrived(self.everything, b"rightly")


def arrived(ear, last):
    heard = []
    while (sample := ear.recv()).payload.to_bytes() != last:
        heard.append(str(sample.key_expr))
    return bool(heard)


def awaited(publisher):
    changes = publisher.declare_matching_listener(zenoh.handlers.FifoChannel(4))
    while not publisher.matching_status.matching:
        changes.recv()
    changes.undeclare()
    return publisher


def free_port():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


@pytest.fixture(params=["passwords", "certificates"])
def star(request, tmp_path):
    with Star(tmp_path, request.param) as made:
        yield made


@pytest.fixture
def certified(tmp_path):
    with Star(tmp_path, "certificates") as made:
        yield made


def without_access_control(config):
    config["access_control"] = {"enabled": False}


def without_client_certificates(config):
    config["transport"]["link"]["tls"]["enable_mtls"] = False


def without_ids(config):
    for subject in config["access_control"]["subjects"]:
        subject.pop("zids", None)


# ---- who has no proof


@both
def test_nobody_enters_without_a_certificate(certified, protected):
    certified.listen(None if protected else without_client_certificates)
    config = client(certified.login("agent-1"), SOON)
    tls = config["transport"]["link"]["tls"]
    config["transport"]["link"]["tls"] = {"root_ca_certificate": tls["root_ca_certificate"]}
    assert certified.is_let_in(config) is not protected


def made_elsewhere(folder, _certified):
    authority.make(folder, ["agent-1"], [], timedelta(days=1))


def expired(folder, certified):
    for name in ("authority.pem", "authority.key"):
        folder.mkdir(mode=0o700, exist_ok=True)
        (folder / name).write_bytes(Path(certified.login(HUB).keys, name).read_bytes())
        (folder / name).chmod(0o600)
    authority.make(folder, ["agent-1"], [], timedelta(seconds=-1))


@both
@pytest.mark.parametrize("make", [made_elsewhere, expired])
def test_nobody_enters_with_a_certificate_of_another_authority_or_time(certified, make, protected, tmp_path):
    make(tmp_path / "other", certified)
    certified.listen(None if protected else without_client_certificates)
    config = client(certified.login("agent-1"), SOON)
    tls = config["transport"]["link"]["tls"]
    tls["connect_certificate"], tls["connect_private_key"] = (
        str(tmp_path / "other" / f"agent-1.{suffix}") for suffix in ("pem", "key")
    )
    assert certified.is_let_in(config) is not protected


@both
@pytest.mark.parametrize("guess", [None, "guess"])
def test_nobody_enters_without_the_password(tmp_path, guess, protected):
    with Star(tmp_path, "passwords") as star:
        star.listen(None if protected else without_passwords)
        config = client(star.login("agent-1", password=guess), SOON)
        if guess is None or not protected:
            without_passwords(config)
        assert star.is_let_in(config) is not protected


def without_passwords(config):
    del config["transport"]["auth"]


@both
def test_who_listens_on_the_way_reads_nothing(tmp_path, protected):
    with Star(tmp_path, "certificates" if protected else "passwords") as star, overheard(star) as (port, bytes_of):
        star.listen()
        agent = star.open(client(star.login("agent-2", endpoint=f"{star.endpoint.rpartition(':')[0]}:{port}"), SOON))
        assert not star.gets_through(agent, lambda _: None)
        assert (b"rightly" in bytes_of()) is not protected


@contextmanager
def overheard(star):
    """A port that passes on to the hub what comes, and all that came."""
    kept, listening = [], socket.create_server(("127.0.0.1", 0))
    target = ("127.0.0.1", int(star.endpoint.rpartition(":")[2]))

    def carry(source, sink):
        with suppress(OSError):  # either end may leave first
            while data := source.recv(65536):
                kept.append(data)
                sink.sendall(data)
            sink.shutdown(socket.SHUT_WR)

    def accept():
        ours, _ = listening.accept()
        with ours, socket.create_connection(target) as theirs:
            back = threading.Thread(target=carry, args=(theirs, ours))
            back.start()
            carry(ours, theirs)
            back.join()

    thread = threading.Thread(target=accept)
    thread.start()
    with listening:
        yield listening.getsockname()[1], lambda: b"".join(kept)
        star.__exit__()
        thread.join()


@both
def test_an_agent_that_listens_is_not_taken_for_the_hub(certified, protected, monkeypatch):
    if not protected:  # certificates that are good for anything
        monkeypatch.setattr(authority, "_for", lambda builder, *_: builder)
        monkeypatch.setattr(authority, "_of_client", lambda builder: authority._of_hub(builder, ["127.0.0.1"]))
        authority.make(Path(certified.login(HUB).keys), NAMES, [], timedelta(days=1))

    def as_agent(config):
        for word in ("listen_certificate", "listen_private_key"):
            tls = config["transport"]["link"]["tls"]
            tls[word] = tls[word].replace(f"/{HUB}.", "/agent-2.")

    certified.listen(as_agent)
    assert certified.is_let_in(client(certified.login("agent-1"), SOON)) is not protected


@both
def test_a_hub_elsewhere_than_its_certificate_says_is_not_taken_for_it(certified, protected):
    certified.endpoint = certified.endpoint.replace("127.0.0.1", "127.0.0.2")
    certified.listen()
    config = client(certified.login("agent-1"), SOON)
    if not protected:
        config["transport"]["link"]["tls"]["verify_name_on_connect"] = False
    assert certified.is_let_in(config) is not protected


# ---- an agent with a proof of its own


SPOKEN = {
    "as another agent": KEYS.broadcast(1, "input"),
    "as all agents": KEYS.broadcast("*", "*"),
    "another's input": KEYS.act(1),
    "everybody's input": KEYS.act("*"),
    "as the world": KEYS.sense,
    "as the medium": KEYS.journal,
    "into another's inbox": KEYS.inbox(1),
    "as the centre": KEYS.told(1),
    "as the driver": KEYS.measured(2),
    "to a robot": KEYS.command(2),
    "into an earlier run": Keys("earlier").broadcast(2, "input"),
    "to everybody": "affinet/**",
}


@both
@pytest.mark.parametrize("how", ["put", "delete"])
@pytest.mark.parametrize("key", SPOKEN.values(), ids=SPOKEN.keys())
def test_an_agent_speaks_as_itself_alone(star, key, how, protected):
    star.listen(None if protected else without_access_control)
    agent = star.join("agent-2")
    say = {"put": lambda session: session.put(key, b"a lie"), "delete": lambda session: session.delete(key)}[how]
    assert star.gets_through(agent, say) is not protected


@both
def test_an_agent_deletes_nothing_on_its_own_keys_either(star, protected):
    star.listen(None if protected else without_access_control)
    agent = star.join("agent-2")
    assert star.gets_through(agent, lambda session: session.delete(KEYS.broadcast(2, "input"))) is not protected


NOT_OF_A_DRIVER = {
    "as an agent": KEYS.act(1),
    "in the air": KEYS.broadcast(1, "input"),
    "as the world": KEYS.sense,
    "to its own robots": KEYS.command(1),
    "into an inbox": KEYS.inbox(1),
    "into an earlier run": Keys("earlier").measured(1),
}


@both
@pytest.mark.parametrize("key", NOT_OF_A_DRIVER.values(), ids=NOT_OF_A_DRIVER.keys())
def test_a_driver_says_what_is_measured_alone(star, key, protected):
    star.listen(None if protected else without_access_control)
    driver = star.join(DRIVER)
    lies = star.gets_through(driver, lambda session: session.put(key, b"a lie"), KEYS.measured(1))
    assert lies is not protected


HEARD = {
    "another's inbox": (KEYS.inbox(1), KEYS.inbox(1)),
    "inboxes": (KEYS.inbox("*"), KEYS.inbox(1)),
    "everything of it": (f"affinet/{KEYS.run}/**", KEYS.inbox(1)),
    "everything": ("**", KEYS.inbox(1)),
    "what others broadcast": (KEYS.broadcast("*", "*"), KEYS.broadcast(1, "input")),
    "what others do": (KEYS.act("*"), KEYS.act(1)),
    "the truth": (KEYS.sense, KEYS.sense),
    "the verdicts": (KEYS.journal, KEYS.journal),
    "what robots measure": (KEYS.measured("*"), KEYS.measured(2)),
    "what robots are told": (KEYS.command("*"), KEYS.command(2)),
}


@both
@pytest.mark.parametrize(("spied", "said"), HEARD.values(), ids=HEARD.keys())
def test_an_agent_hears_its_own_inbox_alone(star, spied, said, protected):
    star.listen(None if protected else without_access_control)
    star.everything.undeclare()
    agent = star.join("agent-2")
    ear = agent.declare_subscriber(spied, zenoh.handlers.FifoChannel(ROOM))
    own = agent.declare_subscriber(KEYS.inbox(2), zenoh.handlers.FifoChannel(ROOM))
    awaited(star.hub.declare_publisher(KEYS.inbox(2)))
    star.hub.put(said, b"of another")
    star.hub.put(KEYS.inbox(2), b"own")
    assert own.recv().payload.to_bytes() == b"own"
    heard = [str(sample.key_expr) for sample in iter(ear.try_recv, None)]
    assert (said in heard) is not protected


@both
def test_only_the_control_login_asks_for_the_faults_of_a_run(star, protected):
    star.listen(None if protected else without_access_control)
    asked = star.hub.declare_queryable(KEYS.control, lambda query: query.reply(KEYS.control, b"cut"))
    control = star.join(CONTROL)
    assert answers(control, KEYS.control) == [b"cut"]
    assert (answers(star.join("agent-2"), KEYS.control) == [b"cut"]) is not protected
    asked.undeclare()


@both
def test_nobody_answers_for_the_medium(star, protected):
    star.listen(None if protected else without_access_control)
    posing = star.join("agent-2").declare_queryable(KEYS.control, lambda query: query.reply(KEYS.control, b"a lie"))
    assert (answers(star.join(CONTROL), KEYS.control) == [b"a lie"]) is not protected
    posing.undeclare()


def answers(session, key):
    return [reply.ok.payload.to_bytes() for reply in session.get(key, timeout=5.0) if reply.ok]


@both
@pytest.mark.parametrize("name", [CONTROL, "agent-2"])
def test_nobody_looks_into_the_hub(star, name, protected):
    def open_space(config):
        without_access_control(config)
        config["adminspace"] = {"enabled": True}

    star.listen(None if protected else open_space)
    assert bool(answers(star.join(name), f"@/{identity(HUB)}/**")) is not protected


@both
@pytest.mark.parametrize("size", [16 * LARGEST + 1])
def test_what_is_too_long_comes_to_nobody(star, size, protected):
    star.listen(None if protected else lambda config: config.pop("low_pass_filter"))
    agent = star.join("agent-2")
    assert star.gets_through(agent, lambda session: whole(session, KEYS.broadcast(2, "theta"), size)) is not protected
    assert star.gets_through(agent, lambda session: whole(session, KEYS.broadcast(2, "theta"), 16 * LARGEST))


@both
def test_not_even_the_world_says_what_would_fill_the_memory_of_the_hub(star, protected, monkeypatch):
    monkeypatch.setattr(session_config, "_LARGEST_OF_ALL", 2**21)  # as 64 MiB take a busy machine a while
    star.listen(None if protected else lambda config: config["transport"]["link"].pop("rx"))
    world, agent = star.join(WORLD), star.join("agent-2")
    awaited(world.declare_publisher(KEYS.sense))
    whole(world, KEYS.sense, 2**22)
    world.put(KEYS.sense, b"sensed", congestion_control=BLOCK)
    assert arrived(star.everything, b"sensed") is not protected
    assert not star.gets_through(agent, lambda _: None)


def whole(session, key, size):
    session.put(key, bytes(size), congestion_control=BLOCK)


# ---- several sessions of one login


@both
def test_a_second_session_of_a_login_may_do_nothing(star, protected):
    star.listen(None if protected else without_ids)
    star.join("agent-1")
    second = star.join("agent-1", id="5ec0d")
    say = KEYS.broadcast(1, "input")
    if not protected:
        awaited(second.declare_publisher(say))
    second.put(say, b"twice")
    assert (star.gets_through(star.join("agent-2"), lambda _: answers(second, KEYS.control))) is not protected


@both
def test_the_session_of_a_login_is_not_opened_twice(star, protected):
    star.listen()
    star.join("agent-1")
    again = client(star.login("agent-1"), SOON) | ({} if protected else {"id": "5ec0d"})
    assert star.is_let_in(again) is not protected
    assert star.gets_through(star.join("agent-2"), lambda _: None) is False


@both
def test_nobody_takes_the_session_of_another(star, protected):
    star.listen()
    star.join("agent-1")
    posing = client(star.login("agent-2"), SOON) | ({"id": identity("agent-1")} if protected else {})
    assert star.is_let_in(posing) is not protected


@both
def test_there_are_no_more_sessions_than_logins(star, protected):
    star.listen(None if protected else lambda config: config["transport"]["unicast"].pop("max_sessions"))
    entered = [star.is_let_in(client(star.login("agent-2"), SOON / 7) | {"id": f"5ec0d{n}"}) for n in range(1, 13)]
    assert sum(entered) == (len(NAMES) - 1 + 3 if protected else 12)  # and three of whoever injects


@pytest.mark.parametrize("called", ["5ec0d", identity(WORLD), f"{identity(CONTROL)}5ec0d"])
def test_a_stranger_among_the_sessions_is_noticed_and_named(certified, called):
    login = certified.login
    with Session(hub(login(HUB), None, KEYS, AGENTS, {})) as session:
        door = session.doorway(NAMES)
        ear = session.hears(KEYS.broadcast("*", "*"), 16)
        agent = certified.join("agent-1")
        for _ in range(2):
            certified.join(CONTROL)
        certified.join("agent-2", id=called)
        awaited(agent.declare_publisher(KEYS.broadcast(1, "input"))).put(b"here")
        assert ear.next().data == b"here"
        with pytest.raises(StrangerEntered, match=rf"^agent-2 opened a session called {called}: "):
            door.refuse_strangers()
        door.refuse_strangers()


# ---- another user of the machine

NOBODY = 65534


@both
@pytest.mark.skipif(os.geteuid() != 0, reason="only root can be another user")
def test_another_user_does_not_reach_the_socket(tmp_path, protected):
    with tempfile.TemporaryDirectory(dir="/tmp") as private, Star(tmp_path, "passwords") as star:
        path = Path(private, "z.sock")
        star.endpoint = f"unixsock-stream/{path}"
        star.listen()
        if not protected:
            for opened in (path.parent, path):
                opened.chmod(0o777)
        assert reaches(path, as_user=NOBODY) is not protected
        assert reaches(path, as_user=0)


def reaches(path, as_user):
    pid = os.fork()  # no Zenoh in it
    if pid == 0:
        status = 1
        try:
            os.setuid(as_user)
            with socket.socket(socket.AF_UNIX) as knocking:
                knocking.connect(str(path))
            status = 0
        finally:
            os._exit(status)
    return os.waitpid(pid, 0)[1] == 0
