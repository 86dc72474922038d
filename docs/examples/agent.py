"""An agent made with a Zenoh client and a MessagePack codec alone, by docs/protocol.md: it keeps its place by the stress."""

import json
import math
import os
import struct
import sys
import threading

import msgpack
import zenoh


def read(size):
    data = b""
    while len(data) < size:
        if not (chunk := os.read(0, size - len(data))):
            sys.exit("standard input closed before the brief was complete")
        data += chunk
    return data


def leave_with_the_launcher():
    while os.read(0, 4096):
        pass
    os._exit(1)


def steered(brief, sensed, velocity):
    """Down the stress: u = -sum of l_ij (z_i - z_j), over the neighbours that were measured; a leader stays where it is."""
    weight = dict(zip(brief["neighbours"], brief["brief"]["stress"], strict=False))  # the stress is padded
    pull = [-2.0 * v for v in velocity]  # what integrates its input twice would swing
    for neighbour, away in () if brief["brief"]["leader"] else sensed:
        pull = [u - weight[neighbour] * z for u, z in zip(pull, away, strict=True)]
    length, limit = math.hypot(*pull), brief["limit"] or math.inf
    return pull if length <= limit else [limit / length * u for u in pull]


brief = msgpack.unpackb(read(*struct.unpack("<I", read(4))))
threading.Thread(target=leave_with_the_launcher, daemon=True).start()
login, me, D = brief["login"], brief["agent"], len(brief["brief"]["nominal"])
config = {
    "mode": "client",
    "id": login["name"].encode().hex(),
    "connect": {"endpoints": [login["endpoint"]], "timeout_ms": 10000, "retry": {"period_init_ms": 20}},
    "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    "transport": {"auth": {"usrpwd": {"user": login["name"], "password": login["password"]}}},
}
with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
    base = f"affinet/{brief['run']}/agent/{me}"
    inboxes = session.declare_subscriber(f"{base}/rx", zenoh.handlers.FifoChannel(64))
    voices = {key: session.declare_publisher(f"{base}/{key}") for key in ("tx/input", "tx/measurement", "act")}
    for voice in voices.values():  # what is said before anybody hears is lost
        changes = voice.declare_matching_listener(zenoh.handlers.FifoChannel(4))
        while not voice.matching_status.matching:
            changes.recv()
    print('{"event": "ready"}', flush=True)
    flying, heard = [0.0] * D, 0
    for number, sample in enumerate(inboxes):
        inbox = msgpack.unpackb(sample.payload.to_bytes())
        if inbox["seq"] != number:
            sys.exit(f"inbox {inbox['seq']} came where {number} was due")
        envelope = {"k": inbox["k"], "src": me, "seq": number // 2}  # two inboxes a tick, one message on each key
        if inbox["phase"] == "sense":
            motion = list(struct.iter_unpack(f"<{D}d", inbox["motion"] or b""))
            measured = zip(inbox["neighbours"], struct.iter_unpack(f"<{D}d", inbox["measured"]), strict=True)
            names = ("velocity", "acceleration", "jerk", "snap")
            said = {
                "input": dict(zip(names, [*motion, flying], strict=False)),
                "measurement": {"neighbours": inbox["neighbours"], "measured": inbox["measured"]},
            }
            for channel, payload in said.items():
                voices[f"tx/{channel}"].put(msgpack.packb({**envelope, "channel": channel, "payload": payload}))
            flying = steered(brief, measured, motion[0] if motion else [0.0] * D)
        elif inbox["phase"] == "exchange":
            heard += len(inbox["messages"])
            unsaid = {"estimate": [], "known": [], "covariance": [], "psi": math.nan, "feasible": None, "reports": {}}
            voices["act"].put(msgpack.packb({**envelope, "input": flying, "heard": heard, **unsaid}))
        elif inbox["phase"] == "end":
            break
        else:
            sys.exit(f"an inbox of phase {inbox['phase']!r}")
print('{"event": "done"}', flush=True)
