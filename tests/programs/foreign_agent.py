"""An agent written with a Zenoh client and a MessagePack codec alone, by docs/protocol.md: it holds still."""

import json
import os
import struct
import sys
import threading

import msgpack
import zenoh


def read_exactly(size: int) -> bytes:
    data = b""
    while len(data) < size:
        data += os.read(0, size - len(data))
    return data


def leave_with_the_launcher() -> None:
    while os.read(0, 4096):
        pass
    os._exit(1)


def main() -> None:
    (length,) = struct.unpack("<I", read_exactly(4))
    brief = msgpack.unpackb(read_exactly(length))
    threading.Thread(target=leave_with_the_launcher, daemon=True).start()
    login, me = brief["login"], brief["agent"]
    config = {
        "mode": "client",
        "id": login["name"].encode().hex(),
        "connect": {"endpoints": [login["endpoint"]], "timeout_ms": 10000, "retry": {"period_init_ms": 20}},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"auth": {"usrpwd": {"user": login["name"], "password": login["password"]}}},
    }
    base = f"affinet/{brief['run']}/agent/{me}"
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        inbox = session.declare_subscriber(f"{base}/rx", zenoh.handlers.FifoChannel(64))
        if brief["hears_centre"]:
            session.declare_subscriber(f"{base}/told", lambda _: None)
        channels = ["input", "measurement"]
        broadcasts = {name: session.declare_publisher(f"{base}/tx/{name}") for name in channels}
        act = session.declare_publisher(f"{base}/act")
        for publisher in [*broadcasts.values(), act]:
            changes = publisher.declare_matching_listener(zenoh.handlers.FifoChannel(4))
            if not publisher.matching_status.matching:
                while not changes.recv().matching:
                    pass
        print('{"event": "ready"}', flush=True)
        heard, seq = 0, 0
        for sample in inbox:
            message = msgpack.unpackb(sample.payload.to_bytes())
            if message["phase"] == "end":
                print('{"event": "done"}', flush=True)
                return
            if message["phase"] == "sense":
                said = {
                    "input": {"velocity": [0.0, 0.0]},
                    "measurement": {"neighbours": message["neighbours"], "measured": message["measured"]},
                }
                for name in channels:
                    envelope = {"k": message["k"], "src": me, "channel": name, "seq": seq, "payload": said[name]}
                    broadcasts[name].put(msgpack.packb(envelope))
                continue
            heard += len(message["messages"])
            belief = {
                "estimate": [],
                "known": [],
                "covariance": [],
                "psi": float("nan"),
                "feasible": None,
                "reports": {},
            }
            decision = {"input": [0.0, 0.0], "heard": heard} | belief
            act.put(msgpack.packb({"k": message["k"], "src": me, "seq": seq} | decision))
            seq += 1


if __name__ == "__main__":
    sys.exit(main())
