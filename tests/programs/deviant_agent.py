"""An agent that speaks as docs/protocol.md says, but for one thing, which is its first argument."""

import json
import math
import os
import pathlib
import struct
import sys
import threading

import msgpack
import zenoh

WRONG = sys.argv[1]
TICK = 6  # in which what happens once does; of the suite's flights only the plain one gets there


def read(size):
    data = b""
    while len(data) < size:
        if not (chunk := os.read(0, size - len(data))):
            if WRONG == "ignores its lifeline":
                threading.Event().wait()
            sys.exit(1)
        data += chunk
    return data


def leave_with_the_launcher():
    while os.read(0, 4096):
        pass
    if WRONG != "ignores its lifeline":
        os._exit(1)


def tell(line):
    print(line, flush=True)


brief = msgpack.unpackb(read(*struct.unpack("<I", read(4))))
threading.Thread(target=leave_with_the_launcher, daemon=True).start()
login, me, D = brief["login"], brief["agent"], len(brief["brief"]["nominal"])
if WRONG == "flat":
    D = 2
config = {
    "mode": "client",
    "id": login["name"].encode().hex(),
    "connect": {"endpoints": [login["endpoint"]], "timeout_ms": 10000, "retry": {"period_init_ms": 20}},
    "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    "transport": {"auth": {"usrpwd": {"user": login["name"], "password": login["password"]}}},
}
session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
base = f"affinet/{brief['run']}/agent/{me}"
inboxes = session.declare_subscriber(
    f"{base}/rx" if WRONG != "deaf" else f"{base}/told", zenoh.handlers.FifoChannel(64)
)
keys = {"input": "tx/input", "measurement": "tx/measurement", "strange": "tx/strange", "act": "act"}
voices = {name: session.declare_publisher(f"{base}/{key}") for name, key in keys.items()}
for name in ("input", "measurement", "act"):
    changes = voices[name].declare_matching_listener(zenoh.handlers.FifoChannel(4))
    while not voices[name].matching_status.matching:
        changes.recv()
numbers, flying, heard = dict.fromkeys(keys, 0), [0.0] * D, 0
kept = pathlib.Path(login["endpoint"].partition("/")[2]).with_name("kept")  # of the process before
if kept.exists():
    of_before = json.loads(kept.read_text())
    numbers = of_before["numbers"] if WRONG == "keeps its numbers" else numbers
    flying = of_before["flying"] if WRONG == "keeps its input" else flying
    heard = of_before["heard"] if WRONG == "keeps its count" else heard


def say(name, k, fields):
    message = {"k": k, "src": me, "seq": numbers[name]} | fields
    if name != "act":
        message = {"k": k, "src": me, "channel": name, "seq": numbers[name], "payload": fields}
    at_it = k == TICK
    match WRONG:
        case "tells an old tick" if at_it:
            message["k"] -= 1
        case "speaks as another" if at_it:
            message["src"] = 1
        case "skips a number" if at_it and name == "input":
            numbers[name] += 1
            message["seq"] += 1
        case "forgets a channel" if at_it and name == "input":
            return
        case "does not act" if at_it and name == "act":
            return
        case "is mute" if at_it:
            return
    numbers[name] += 1
    voices[name].put(msgpack.packb(message))
    if WRONG == "speaks twice" and at_it and name == "measurement":
        voices[name].put(msgpack.packb(message | {"seq": numbers[name]}))
        numbers[name] += 1


def live(flying, heard):
    before, last, due, times = flying, -1, 0, set()
    if (WRONG == "cannot remember" and brief["remembers"]) or (WRONG == "knows few" and len(brief["neighbours"]) > 40):
        sys.exit(1)
    for sample in inboxes:
        try:
            inbox = msgpack.unpackb(sample.payload.to_bytes())
            phase = {"sense": "sense", "exchange": "exchange", "end": "end"}[inbox["phase"]]
        except (ValueError, KeyError):
            if WRONG == "leaves garbage aside":
                continue
            if WRONG == "leaves garbage in peace":
                return
            raise
        if inbox["seq"] != due and WRONG != "overlooks gaps":
            sys.exit(f"inbox {inbox['seq']} came where {due} was due")
        due += 1
        k = inbox["k"]
        if phase == "end":
            if WRONG == "stays":
                continue
            return
        if phase == "sense":
            if WRONG == "dies of silence" and not inbox["neighbours"]:
                sys.exit("nothing measured")
            if WRONG == "takes the time from its clock":
                k = inbox["clock"]
            if WRONG == "is no leader" and inbox["position"] is not None:
                sys.exit("told where it is")
            if WRONG == "forgets its input in a pause" and k > last + 1:
                flying = [0.0] * D
            if WRONG == "begins anew after a pause" and k > last + 1:
                numbers.update(dict.fromkeys(keys, 0))
            last = k
            motion = struct.iter_unpack(f"<{D}d", inbox["motion"] or b"")
            told = before if WRONG == "tells an old input" else flying
            names = ("velocity", "acceleration")
            payload = {name: list(row) for name, row in zip(names, [*motion, told], strict=False)}
            if WRONG == "knows one integrator":
                payload = {"velocity": flying}
            if WRONG == "broadcasts another shape" and k == TICK:
                payload["velocity"] = [*flying, 0.0]
            say("input", k, payload)
            say("measurement", k, {"neighbours": inbox["neighbours"], "measured": inbox["measured"]})
            if WRONG == "speaks on a channel of its own" and k == TICK:
                say("strange", k, {})
            if WRONG == "prints" and k == TICK:
                tell("a tick")
            continue
        for said in inbox["messages"]:
            name = (said["k"], said["src"], said["channel"])
            late, again = said["k"] < k, name in times
            times.add(name)
            heard += not ((WRONG == "counts no late ones" and late) or (WRONG == "counts no doubles" and again))
        if WRONG == "miscounts" and k == TICK:
            heard += 1
        before, flying = flying, [0.001 * (k + 1)] * D
        if WRONG == "goes too fast":
            flying = [1.0] * D
        if WRONG == "holds still":
            flying = [0.0] * D
        if WRONG == "diverges" and k == TICK:
            flying = [math.inf] * D
        beliefs = {"estimate": [], "known": [], "covariance": [], "psi": math.nan, "feasible": None, "reports": {}}
        if WRONG == "believes of too many" and k == TICK:
            beliefs["estimate"] = [[0.0] * D] * 9
        say("act", k, {"input": flying, "heard": heard} | beliefs)
        kept.write_text(json.dumps({"numbers": numbers, "flying": flying, "heard": heard}))


if WRONG == "speaks at once":
    say("measurement", 0, {"neighbours": [], "measured": b""})
if WRONG == "is never ready":
    threading.Event().wait()
tell('{"event": "ready"}')
live(flying, heard)
if WRONG != "does not say that it is done":
    tell('{"event": "done"}')
session.close()
if WRONG == "leaves with an error":
    sys.exit(3)
