"""What is drawn at a terminal."""

import os
from contextlib import suppress


def written_to(terminal):
    """All that was, in whatever pieces it comes, until its other end was closed."""
    pieces = []
    with suppress(OSError):
        while piece := os.read(terminal, 65536):
            pieces.append(piece)
    os.close(terminal)
    return b"".join(pieces).decode()
