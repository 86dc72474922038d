"""Fixtures of all tests."""

import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A run directory to be made."""
    return tmp_path / "run"


@pytest.fixture(autouse=True, scope="session")
def signals_as_at_a_terminal() -> Iterator[None]:
    """Undo what nohup, or a shell in the background, has the tests and every process they start ignore."""
    wanted = {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: signal.SIG_DFL}
    before = {number: signal.signal(number, handler) for number, handler in wanted.items()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def free_endpoint() -> str:
    """Where to listen over TLS on this machine: at a port that is free."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"tls/127.0.0.1:{free.getsockname()[1]}"
