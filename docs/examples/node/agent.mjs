// An agent for Node, by docs/protocol.md: it keeps its place by the stress, as docs/examples/agent.py does.

import { float, pack, unpack } from "./msgpack.mjs";
import { Session } from "./zenoh.mjs";

const DERIVATIVES = ["velocity", "acceleration", "jerk", "snap"];

const tell = (event) => process.stdout.write(JSON.stringify(event) + "\n");

function fail(reason) {
  process.stdout.write(JSON.stringify({ event: "failed", reason }) + "\n", () => process.exit(1));
}

// The brief, and then nothing, until the launcher is gone.
function briefing() {
  let data = Buffer.alloc(0), resolved = false;
  return new Promise((resolve) => {
    process.stdin.on("data", (chunk) => {
      if (resolved) return;
      data = Buffer.concat([data, chunk]);
      if (data.length < 4 || data.length < 4 + data.readUInt32LE()) return;
      resolved = true;
      resolve(unpack(data.subarray(4, 4 + data.readUInt32LE())));
    });
    process.stdin.on("end", () => process.exit(1));
  });
}

function rows(data, width) {
  const numbers = Array.from({ length: data.length / 8 }, (_, n) => data.readDoubleLE(8 * n));
  return Array.from({ length: numbers.length / width }, (_, n) => numbers.slice(n * width, (n + 1) * width));
}

function packed(numbers) {
  const data = Buffer.alloc(8 * numbers.length);
  numbers.forEach((value, n) => data.writeDoubleLE(value, 8 * n));
  return data;
}

// Down the stress: u = - sum of l_ij (z_i - z_j), over the neighbours that were measured; a leader stays where it is.
function steered(brief, neighbours, measured, velocity) {
  const pull = velocity.map((v) => -2 * v); // what integrates its input twice would swing
  if (!brief.brief.leader)
    neighbours.forEach((neighbour, n) => {
      const weight = brief.brief.stress[brief.neighbours.indexOf(neighbour)];
      measured[n].forEach((z, axis) => (pull[axis] -= weight * z));
    });
  const shorten = Math.min(1, (brief.limit ?? Infinity) / (Math.hypot(...pull) || 1));
  return pull.map((u) => shorten * u);
}

async function fly() {
  const brief = await briefing();
  const session = await Session.open(brief.login);
  const base = `affinet/${brief.run}/agent/${brief.agent}`;
  const width = brief.brief.nominal.length;
  const say = (name, message) => session.publish(`${base}/${name}`, pack(message));
  let flying = Array(width).fill(0), heard = 0, due = 0;

  function live(data) {
    const inbox = unpack(data);
    if (inbox.seq !== due) throw new Error(`inbox ${inbox.seq} came where ${due} was due`);
    const envelope = { k: inbox.k, src: brief.agent, seq: due++ >> 1 }; // two inboxes a tick, one message on each key
    if (inbox.phase === "sense") {
      const motion = rows(inbox.motion ?? Buffer.alloc(0), width);
      const derivatives = [...motion, flying].map((values, order) => [DERIVATIVES[order], packed(values)]);
      const { neighbours, measured } = inbox;
      say("tx/input", { ...envelope, channel: "input", payload: Object.fromEntries(derivatives) });
      say("tx/measurement", { ...envelope, channel: "measurement", payload: { neighbours, measured } });
      flying = steered(brief, neighbours, rows(measured, width), motion[0] ?? Array(width).fill(0));
    } else if (inbox.phase === "exchange") {
      heard += inbox.messages.length;
      const unsaid = { estimate: [], known: [], covariance: [], psi: float(NaN), feasible: null, reports: {} };
      say("act", { ...envelope, input: packed(flying), heard, ...unsaid });
    } else if (inbox.phase === "end") {
      tell({ event: "done" });
      session.close().then(() => process.exit(0));
    } else {
      throw new Error(`an inbox of phase ${inbox.phase}`);
    }
  }

  session.subscribe(`${base}/rx`, (data) => {
    try {
      live(data);
    } catch (error) {
      fail(String(error));
    }
  });
  await Promise.all(["tx/input", "tx/measurement", "act"].map((name) => session.awaitHeard(`${base}/${name}`)));
  tell({ event: "ready" });
}

fly().catch((error) => fail(String(error)));
