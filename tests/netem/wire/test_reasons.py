"""What Zenoh says of why it cannot is told once, without the places in its source."""

import pytest

from netem.wire import reasons
from netem.wire.carrier import NotCarried, Session

AT = "/root/.cargo/git/checkouts/zenoh-9c599d5ef3e0480e/cc83980/io"
SAID = {
    "Can not create a new TLS listener on 192.0.2.1:7447: 192.0.2.1:7447: Cannot assign requested address (os error 99) at "
    f"{AT}/zenoh-link-commons/src/tcp.rs:61. at {AT}/zenoh-links/zenoh-link-tls/src/unicast.rs:432.": (
        "Can not create a new TLS listener on 192.0.2.1:7447: Cannot assign requested address"
    ),
    "Can not create a new TCP listener bound to tcp/192.0.2.1:7447: [192.0.2.1:7447: Cannot assign requested address "
    f"(os error 99) at {AT}/zenoh-link-commons/src/tcp.rs:61.] at {AT}/zenoh-links/zenoh-link-tcp/src/unicast.rs:338.": (
        "Can not create a new TCP listener bound to tcp/192.0.2.1:7447: Cannot assign requested address"
    ),
    f"failed to lookup address information: Name or service not known at {AT}/zenoh-link-commons/src/lib.rs:62.": (
        "failed to lookup address information: Name or service not known"
    ),
    "Unable to connect to any of [Single(tcp/127.0.0.1:1)]. Timeout! at /root/orchestrator.rs:388.": (
        "Unable to connect to any of [Single(tcp/127.0.0.1:1)]. Timeout!"
    ),
}


@pytest.mark.parametrize("said", SAID)
def test_the_reason_alone(said):
    assert reasons.plain(said) == SAID[said]


def test_a_session_that_cannot_listen_says_it_so():
    config = {
        "mode": "router",
        "listen": {"endpoints": ["tcp/203.0.113.1:7447"]},
        "scouting": {"multicast": {"enabled": False}},
    }
    with pytest.raises(NotCarried, match=r"tcp/203\.0\.113\.1:7447: Cannot assign requested address$"):
        Session(config)
