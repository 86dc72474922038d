"""Certificates: how they are made, and whoever is refused is told why in one line; what they keep out: test_trust.py."""

import socket
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path

import pytest

from netem.wire import authority
from netem.wire.carrier import NotCarried, Session, joined
from netem.wire.certificates import Certificates, NotTrusted
from netem.wire.keys import Keys
from netem.wire.rights import hub
from netem.wire.session import HUB, Login, agent_name, client

KEYS = Keys("r")
SOON = 1.0


def made(folder, names=(HUB, "agent-1", "agent-2"), addresses=(), lasts=timedelta(days=1)):
    authority.make(folder, names, addresses, lasts)
    return str(folder)


def free_port():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


@contextmanager
def flying(folder):
    """A hub that listens with the certificates of a folder; its endpoint."""
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with Session(hub(Login(endpoint, HUB, keys=folder), None, KEYS, [1, 2], {})) as session:
        yield endpoint, session


def refused(endpoint, name, folder):
    with pytest.raises(NotCarried) as refusal:
        joined(Login(endpoint, name, keys=folder), SOON)
    said = str(refusal.value)
    assert "\n" not in said
    return said


def test_an_agent_with_a_certificate_enters_and_is_heard(tmp_path):
    folder = made(tmp_path / "keys")
    with flying(folder) as (endpoint, session), joined(Login(endpoint, "agent-1", keys=folder), SOON) as agent:
        ear, voice = session.hears(KEYS.broadcast("*", "*"), 4), agent.says(KEYS.broadcast(1, "input"))
        voice.await_heard()
        voice.say(b"here")
        assert ear.next().data == b"here"


def test_a_certificate_of_another_authority_is_refused_by_the_hub(tmp_path):
    folder, other = made(tmp_path / "keys"), made(tmp_path / "other")
    (tmp_path / "other" / "authority.pem").write_bytes((tmp_path / "keys" / "authority.pem").read_bytes())
    with flying(folder) as (endpoint, _):
        # The agent's own look at its files is not what keeps it out.
        stranger = client(Login(endpoint, "agent-1", keys=folder), SOON)
        for kind, suffix in (("certificate", "pem"), ("private_key", "key")):
            stranger["transport"]["link"]["tls"][f"connect_{kind}"] = str(Path(other, f"agent-1.{suffix}"))
        with pytest.raises(NotCarried):
            Session(stranger)
        assert "does not know the authority" in Certificates(other, "agent-1").why_refused("127.0.0.1", port(endpoint))


def port(endpoint):
    return int(endpoint.rpartition(":")[2])


def test_a_hub_of_another_authority_is_not_trusted(tmp_path):
    folder, other = made(tmp_path / "keys"), made(tmp_path / "other")
    with flying(other) as (endpoint, _):
        assert "is not the hub of" in refused(endpoint, "agent-1", folder)


def test_an_agent_is_not_taken_for_the_hub(tmp_path):
    folder = made(tmp_path / "keys")
    endpoint = f"tls/127.0.0.1:{free_port()}"
    posing = hub(Login(endpoint, HUB, keys=folder), None, KEYS, [1, 2], {})
    for kind, suffix in (("certificate", "pem"), ("private_key", "key")):
        posing["transport"]["link"]["tls"][f"listen_{kind}"] = str(Path(folder, f"agent-2.{suffix}"))
    with Session(posing):
        assert "is not the hub of" in refused(endpoint, "agent-1", folder)


def test_a_hub_at_an_address_that_is_not_its_own_is_not_trusted(tmp_path):
    folder = made(tmp_path / "keys")
    with flying(folder) as (endpoint, _):
        assert "127.0.0.2" in refused(endpoint.replace("127.0.0.1", "127.0.0.2"), "agent-1", folder)
    made(tmp_path / "keys", addresses=["127.0.0.2"])
    endpoint = f"tls/127.0.0.2:{free_port()}"
    with (
        Session(hub(Login(endpoint, HUB, keys=folder), None, KEYS, [1, 2], {})),
        joined(Login(endpoint, "agent-1", keys=folder), SOON),
    ):
        pass


def test_an_expired_certificate_is_refused_by_both(tmp_path):
    folder = made(tmp_path / "keys")
    with flying(folder) as (endpoint, _):
        made(tmp_path / "keys", ["agent-1"], lasts=timedelta(seconds=-1))
        with pytest.raises(NotTrusted, match=r"agent-1\.pem: it expired at .*; make them again with `affinet keys`$"):
            joined(Login(endpoint, "agent-1", keys=folder), SOON)
        expired = client(Login(endpoint, "agent-1", keys=made(tmp_path / "valid")), SOON)
        for word in ("root_ca_certificate", "connect_certificate", "connect_private_key"):
            was = Path(expired["transport"]["link"]["tls"][word])
            expired["transport"]["link"]["tls"][word] = str(Path(folder, was.name))
        with pytest.raises(NotCarried):
            Session(expired)
        assert "has expired" in Certificates(folder, "agent-1").why_refused("127.0.0.1", port(endpoint))
        made(tmp_path / "keys")
        with joined(Login(endpoint, "agent-1", keys=folder), SOON):
            pass


def test_nobody_there_is_told_apart_from_refused(tmp_path):
    folder = made(tmp_path / "keys")
    assert "nobody can be reached" in refused(f"tls/127.0.0.1:{free_port()}", "agent-1", folder)


@pytest.mark.parametrize(
    ("endpoint", "keys", "says"),
    [
        ("tcp/10.0.0.1:7447", None, "it would be heard beyond this machine"),
        ("tcp/0.0.0.0:7447", None, "it would be heard beyond this machine"),
        ("tcp/[::]:7447", None, "it would be heard beyond this machine"),
        ("tcp/example.org:7447", None, "it would be heard beyond this machine"),
        ("tls/127.0.0.1:7447", None, "TLS needs the folder"),
        ("tcp/127.0.0.1:7447", "somewhere", "TLS needs the folder"),
        ("udp/127.0.0.1:7447", None, "write it as tls/ADDRESS:PORT"),
        ("tcp/127.0.0.1:7447#bind=10.0.0.1", None, "write it as tls/ADDRESS:PORT"),
        ("tls/127.0.0.1", None, "write it as tls/ADDRESS:PORT"),
    ],
)
def test_nothing_listens_beyond_loopback_without_certificates(endpoint, keys, says):
    with pytest.raises(NotTrusted, match=says):
        hub(Login(endpoint, HUB, "secret", keys), "users", KEYS, [1], {})
    with pytest.raises(NotTrusted, match=says):
        client(Login(endpoint, "agent-1", "secret", keys))


@pytest.mark.parametrize(
    "endpoint", ["tcp/127.0.0.1:7447", "tcp/localhost:7447", "tcp/[::1]:7447", "unixsock-stream/z"]
)
def test_passwords_do_on_this_machine(endpoint):
    assert hub(Login(endpoint, HUB, "secret"), "users", KEYS, [1], {})["listen"] == {"endpoints": [endpoint]}


def test_a_folder_is_for_its_user_alone(tmp_path):
    folder = made(tmp_path / "keys")
    assert Path(folder).stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in Path(folder).iterdir()} == {0o600}
    (tmp_path / "open").mkdir(mode=0o755)
    with pytest.raises(NotTrusted, match=r"open: others may look into it"):
        made(tmp_path / "open")


@pytest.mark.parametrize(
    ("break_it", "says"),
    [
        (lambda folder: (folder / "agent-1.key").chmod(0o640), r"agent-1\.key: others may read it \(mode 640\)"),
        (lambda folder: (folder / "agent-1.key").unlink(), r"agent-1\.key: it is not there"),
        (lambda folder: (folder / "authority.pem").unlink(), r"authority\.pem: it is not there"),
        (lambda folder: (folder / "agent-1.pem").write_text("nothing"), r"agent-1\.pem: it is no certificate"),
        (lambda folder: (folder / "agent-1.key").write_text("nothing"), r"agent-1\.key: it is no private key"),
        (
            lambda folder: (folder / "agent-2.pem").rename(folder / "agent-1.pem"),
            "it is of 'agent-2', and not of 'agent-1'",
        ),
        (lambda folder: (folder / "agent-2.key").rename(folder / "agent-1.key"), "it is not the key to"),
    ],
)
def test_files_that_will_not_do_are_named(tmp_path, break_it, says):
    folder = made(tmp_path / "keys")
    Certificates(folder, "agent-1").check()
    break_it(Path(folder))
    with pytest.raises(NotTrusted, match=says):
        Certificates(folder, "agent-1").check()


def test_files_of_two_authorities_do_not_go_together(tmp_path):
    folder, other = made(tmp_path / "keys"), made(tmp_path / "other")
    Path(other, "authority.pem").rename(Path(folder, "authority.pem"))
    with pytest.raises(NotTrusted, match="it is of another authority"):
        Certificates(folder, "agent-1").check()


def test_made_again_all_are_new_and_of_the_same_authority(tmp_path):
    folder = Path(made(tmp_path / "keys", [HUB, *map(agent_name, (1, 2))], ["lab.example", "10.0.0.1"]))
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    again = authority.make(folder, [agent_name(3)], [], timedelta(days=1))
    assert again.renewed
    assert again.addresses[-2:] == ("lab.example", "10.0.0.1")
    after = {path.name: path.read_bytes() for path in folder.iterdir()}
    same = {name for name in before if before[name] == after[name]}
    assert same == {"authority.pem", "authority.key"}
    assert set(after) - set(before) == {"agent-3.pem", "agent-3.key"}


def test_without_its_key_an_authority_makes_nothing(tmp_path):
    folder = made(tmp_path / "keys")
    Path(folder, "authority.key").unlink()
    with pytest.raises(NotTrusted, match="renew certificates where they were made"):
        made(tmp_path / "keys")


def test_an_address_is_an_address(tmp_path):
    with pytest.raises(NotTrusted, match="'lab:7447': give host names and IP addresses, without ports"):
        made(tmp_path / "keys", addresses=["lab:7447"])


def test_certificates_do_not_outlast_their_authority(tmp_path):
    made(tmp_path / "keys")
    with pytest.raises(NotTrusted, match="before they would"):
        made(tmp_path / "keys", lasts=timedelta(days=4000))


def test_a_password_is_not_in_what_is_printed():
    assert "secret" not in repr(Login("tcp/127.0.0.1:1", "agent-1", "secret"))
