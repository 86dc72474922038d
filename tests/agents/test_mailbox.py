"""What an agent says that the hub would drop is an error of its own, and names it."""

from types import SimpleNamespace

import pytest

from agents.mailbox import Mailbox
from netem.wire.arrays import WireError
from netem.wire.session import LARGEST


@pytest.fixture
def said():
    return []


@pytest.fixture
def mailbox(said):
    session = SimpleNamespace(hears=lambda *_: None, says=lambda _: SimpleNamespace(say=said.append))
    return Mailbox(session, "r", 3, (1, 2), ["place"], hears_centre=False)


def test_what_is_longer_than_anybody_hears_is_not_said(mailbox, said):
    mailbox.broadcast(0, "place", {"place": bytes(LARGEST - 200)})
    assert len(said) == 1
    assert len(said[0]) <= LARGEST
    with pytest.raises(
        WireError, match=rf"^agent 3 says \d+ bytes on 'place', and nobody hears more than {LARGEST} at"
    ):
        mailbox.broadcast(1, "place", {"place": bytes(LARGEST)})
    with pytest.raises(WireError, match=r"^agent 3 says \d+ bytes on 'act'"):
        mailbox.act(
            1, input=b"", estimate=b"", known=b"", covariance=b"", psi=0.0, feasible=None, reports={"x": bytes(LARGEST)}
        )
    assert len(said) == 1
