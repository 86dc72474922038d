"""Watching: a window on this machine's screen, or a page for a browser, both of them on loopback."""

from __future__ import annotations

import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from urllib.parse import quote

from affinet.runtimes.rerun_command import NoViewer, command, last_line
from netem.processes.parent import signal_at_its_end

_START_S = 10.0
_LOOPBACK = "127.0.0.1"
_LOOKED_AFTER_S, _GRACE_S = 0.02, 2.0


def open_viewer() -> str:
    """Start a viewer that outlives the run, and return the URL to stream to.

    Raises
    ------
    NoViewer
        When it cannot start, as on a machine without a screen.
    """
    port = free_port()
    viewer = _Viewer(["--port", str(port), "--expect-data-soon"], outlives=True)
    viewer.await_listening([port])
    viewer.let_go()
    return _stream(port)


def show(files: Sequence[Path]) -> None:
    """Show recordings in a viewer until it is closed.

    Raises
    ------
    NoViewer
        When it cannot start, or fails.
    """
    viewer = _Viewer(["--port", str(free_port()), *_named(files)])
    try:
        viewer.wait()
    finally:
        viewer.end()


class WebViewer:
    """A page with a viewer for as long as the block lasts.

    Parameters
    ----------
    files
        Recordings to show there; without any, what is streamed to it.

    Attributes
    ----------
    page, stream
        URLs of the page, and of where to stream to.

    Raises
    ------
    NoViewer
        When it cannot start.
    """

    def __init__(self, files: Sequence[Path] = ()) -> None:
        port, web = free_port(), free_port()
        self.stream = _stream(port)
        self.page = f"http://{_LOOPBACK}:{web}/?url={quote(self.stream, safe='')}"
        self._server = _Viewer(["--serve-web", "--port", str(port), "--web-viewer-port", str(web), *_named(files)])
        self._server.await_listening([port, web])

    def __enter__(self) -> WebViewer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.end()

    def wait(self) -> None:
        """Serve until the server ends.

        Raises
        ------
        NoViewer
            When it fails.
        """
        self._server.wait()


class _Viewer:
    """The command as a process that ends with this one, unless it `outlives` it."""

    def __init__(self, arguments: Sequence[str], *, outlives: bool = False) -> None:
        # A pipe would fill up, and nobody would read it of a viewer that outlives us.
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `end`
        self._process = subprocess.Popen(
            [command(), "--bind", _LOOPBACK, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._said,
            start_new_session=True,
            preexec_fn=None if outlives else partial(signal_at_its_end, signal.SIGTERM),
        )

    def await_listening(self, ports: Sequence[int]) -> None:
        """Wait until it listens there; a `NoViewer` where it does not."""
        deadline = time.monotonic() + _START_S
        wrong = None
        while wrong is None and not all(map(_listens, ports)):
            try:
                self._process.wait(_LOOKED_AFTER_S)
                wrong = f"ended at once: {self._last_line()}"
            except subprocess.TimeoutExpired:
                wrong = f"did not listen within {_START_S:g} s" if time.monotonic() > deadline else None
        if wrong:
            self.end()
            raise NoViewer(f"the Rerun viewer {wrong}")

    def wait(self) -> None:
        """Wait until it ends; a `NoViewer` where it fails."""
        if self._process.wait():
            raise NoViewer(f"the Rerun viewer ended: {self._last_line()}")

    def end(self) -> None:
        """End it."""
        self._process.terminate()
        try:
            self._process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self.let_go()

    def let_go(self) -> None:
        """Have nothing more to do with it."""
        self._said.close()

    def _last_line(self) -> str:
        self._said.seek(0)
        return last_line(self._said.read())


def _named(files: Sequence[Path]) -> list[str]:
    return [str(file.absolute()) for file in files]  # a name that begins with a dash is no option


def _stream(port: int) -> str:
    return f"rerun+http://{_LOOPBACK}:{port}/proxy"


def free_port() -> int:
    """A port on loopback that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind((_LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex((_LOOPBACK, port)) == 0
