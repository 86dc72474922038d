"""Messages over Zenoh alone: a router that passes them on by itself, who says them, and who hears them, a process each.

    python bench/real_time/direct.py SECONDS RATE BYTES

It prints how long each message took, in seconds, a JSON list.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import tempfile
import time

import zenoh

from netem.wire.session import ENVIRONMENT

_STAMP = struct.Struct("<d")


def _config(mode: str, endpoint: str) -> zenoh.Config:
    where = "listen" if mode == "router" else "connect"
    return zenoh.Config.from_json5(
        json.dumps({"mode": mode, where: {"endpoints": [endpoint]}, "scouting": {"multicast": {"enabled": False}}})
    )


def _say(endpoint: str, seconds: float, rate: float, size: int) -> None:
    with zenoh.open(_config("client", endpoint)) as session:
        voice = session.declare_publisher("direct")
        while not voice.matching_status.matching:
            time.sleep(0.01)
        began = time.monotonic()
        for number in range(int(seconds * rate)):
            time.sleep(max(0.0, began + number / rate - time.monotonic()))
            voice.put(_STAMP.pack(time.monotonic()) + bytes(size))


def _hear(endpoint: str, number: int) -> None:
    took: list[float] = []
    with zenoh.open(_config("client", endpoint)) as session:
        ear = session.declare_subscriber(
            "direct",
            zenoh.handlers.Callback(
                lambda sample: took.append(time.monotonic() - _STAMP.unpack(sample.payload.to_bytes()[:8])[0]),
                indirect=False,
            ),
        )
        print("ready", flush=True)
        while len(took) < number:
            time.sleep(0.05)
        del ear
    print(json.dumps(took))


def measured(seconds: float, rate: float, size: int) -> list[float]:
    """How long messages of so many bytes take, said so many times a second, for so many seconds."""
    with tempfile.TemporaryDirectory() as folder:
        endpoint = f"unixsock-stream/{folder}/z.sock"
        with zenoh.open(_config("router", endpoint)):
            this = [sys.executable, __file__]
            hears = subprocess.Popen(
                [*this, "hear", endpoint, str(int(seconds * rate))], stdout=subprocess.PIPE, text=True
            )
            assert hears.stdout is not None
            hears.stdout.readline()
            subprocess.run([*this, "say", endpoint, str(seconds), str(rate), str(size)], check=True)
            took: list[float] = json.loads(hears.communicate()[0])
    return took


def main() -> None:
    """Measure, or be one of the processes."""
    match sys.argv[1:]:
        case ["say", endpoint, seconds, rate, size]:
            _say(endpoint, float(seconds), float(rate), int(size))
        case ["hear", endpoint, number]:
            _hear(endpoint, int(number))
        case [seconds, rate, size]:
            print(json.dumps(measured(float(seconds), float(rate), int(size))))


if __name__ == "__main__":
    import os

    os.environ |= ENVIRONMENT
    main()
