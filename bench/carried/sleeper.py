"""How late a process is that only sleeps, on a machine on which something else runs.

    python bench/carried/sleeper.py SECONDS

It prints how late it woke each time, in seconds, a JSON list, until its standard input closes.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def sleeping(seconds: float) -> Iterator[list[float]]:
    """A process that sleeps so long again and again while the block runs; after it, by how much it woke late each time."""
    woken: list[float] = []
    command = [sys.executable, __file__, str(seconds)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield woken
        finally:
            woken += json.loads(process.communicate()[0])


def _sleep(seconds: float) -> list[float]:
    woken = []
    waiting = threading.Thread(target=sys.stdin.read, daemon=True)
    waiting.start()
    while waiting.is_alive():
        due = time.monotonic() + seconds
        time.sleep(seconds)
        woken.append(time.monotonic() - due)
    return woken


if __name__ == "__main__":
    print(json.dumps(_sleep(float(sys.argv[1]))))
