// As much of a Zenoh 1.x client as an agent needs, over a stream: log in, subscribe, publish, know who listens.
// Wire format: https://github.com/eclipse-zenoh/zenoh/tree/main/commons/zenoh-protocol

import { createHmac } from "node:crypto";
import { connect } from "node:net";

const [INIT, OPEN, CLOSE, KEEP_ALIVE, FRAME, FRAGMENT] = [1, 2, 3, 4, 5, 6]; // messages of the transport
const [INTEREST, PUSH, DECLARE] = [0x19, 0x1d, 0x1e]; // and of the network
const [AUTH, USER_AND_PASSWORD] = [3, 2]; // extensions
const ACK = 0x20, RELIABLE = 0x20, MORE = 0x40, NAMED = 0x20, EXTENDED = 0x80;
const VERSION = 9, CLIENT = 2, LEASE_S = 3600, LONGEST = 65535, SEQUENCE = 2 ** 28;

function count(value) {
  const bytes = [];
  for (let rest = BigInt(value); ; rest >>= 7n) {
    if (rest < 128n || bytes.length === 8) return Buffer.from([...bytes, Number(rest)]);
    bytes.push(Number(rest & 127n) | 128);
  }
}

const sized = (data) => Buffer.concat([count(data.length), data]);
const key = (name) => Buffer.concat([count(0), sized(Buffer.from(name))]);
const block = (id, data) => Buffer.concat([Buffer.from([id | 0x40]), sized(data)]);

class Reader {
  constructor(data) {
    this.data = data;
    this.at = 0;
    this.header = 0;
  }

  get more() {
    return this.at < this.data.length;
  }

  byte() {
    return this.data[this.at++];
  }

  take(size) {
    return this.data.subarray(this.at, (this.at += size));
  }

  large() {
    for (let value = 0n, shift = 0n; ; shift += 7n) {
      const byte = BigInt(this.byte());
      if (byte < 128n || shift === 56n) return value | (byte << shift);
      value |= (byte & 127n) << shift;
    }
  }

  count() {
    return Number(this.large());
  }

  block() {
    return this.take(this.count());
  }

  // Extensions by their number: nothing, a count, or bytes.
  extensions(header) {
    const found = new Map();
    for (let next = header & EXTENDED; next; ) {
      const head = this.byte();
      const read = [() => null, () => this.large(), () => this.block()][(head >> 5) & 3];
      found.set(head & 15, read());
      next = head & EXTENDED;
    }
    return found;
  }

  key(header) {
    this.count(); // the number of a prefix, of which we declare none
    return header & NAMED ? this.block().toString() : "";
  }
}

export class Session {
  // Logs in at an endpoint like unixsock-stream//tmp/z.sock or tcp/host:port.
  static async open({ endpoint, name, password }) {
    const session = new Session(endpoint);
    await session.logIn(name, password);
    session.listen();
    return session;
  }

  constructor(endpoint) {
    const [, protocol, where] = endpoint.match(/^([^/]+)\/(.*)$/);
    const [, host, port] = protocol === "tcp" ? where.match(/^(.*):(\d+)$/) : [];
    this.socket = connect(protocol === "tcp" ? { host, port } : { path: where });
    this.batches = batches(this.socket);
    this.sent = 0;
    this.fragments = [];
    this.listeners = [];
    this.heard = new Map(); // by our interest in a key: what to do once somebody subscribes to it
  }

  async logIn(name, password) {
    const wanted = block(AUTH, Buffer.from([USER_AND_PASSWORD]));
    const id = Buffer.from(name).reverse(); // the number whose digits spell it, least first
    this.write(Buffer.from([INIT | EXTENDED, VERSION, ((id.length - 1) << 4) | CLIENT]), id, wanted);
    const offered = await this.answer(INIT);
    if (offered.header & 0x40) offered.take(3); // sizes, which are ours or smaller
    const cookie = offered.block();
    const challenge = new Reader(offered.extensions(offered.header).get(AUTH)).extensions(EXTENDED);
    const nonce = Buffer.alloc(8);
    nonce.writeBigUInt64LE(challenge.get(USER_AND_PASSWORD));
    const proof = createHmac("sha3-256", nonce).update(password).digest();
    const login = block(USER_AND_PASSWORD, Buffer.concat([sized(Buffer.from(name)), sized(proof)]));
    const lease = count(LEASE_S); // the flag says that it is in seconds
    this.write(Buffer.from([OPEN | 0x40 | EXTENDED]), lease, count(0), sized(cookie), block(AUTH, login));
    await this.answer(OPEN);
  }

  async answer(kind) {
    const { value, done } = await this.batches.next();
    const reader = new Reader(value ?? Buffer.alloc(0));
    reader.header = reader.more ? reader.byte() : CLOSE;
    if (done || (reader.header & 31) !== kind || !(reader.header & ACK)) throw new Error("the router refuses us");
    if (kind === INIT) {
      reader.byte(); // its version
      reader.take((reader.byte() >> 4) + 1); // and its name
    }
    return reader;
  }

  write(...parts) {
    const batch = Buffer.concat(parts);
    if (batch.length > LONGEST) throw new Error(`${batch.length} bytes are too long a message`);
    const length = Buffer.alloc(2);
    length.writeUInt16LE(batch.length);
    this.socket.write(Buffer.concat([length, batch]));
  }

  send(...parts) {
    this.write(Buffer.from([FRAME | RELIABLE]), count(this.sent), ...parts);
    this.sent = (this.sent + 1) % SEQUENCE;
  }

  subscribe(name, listener) {
    const number = count(this.listeners.push(listener));
    this.send(Buffer.from([DECLARE, 0x02 | NAMED]), number, key(name));
  }

  publish(name, data) {
    this.send(Buffer.from([PUSH | NAMED]), key(name), Buffer.from([0x01]), sized(data));
  }

  // Resolves once somebody subscribes to a key: what is said before is lost.
  awaitHeard(name) {
    return new Promise((resolve) => {
      const interest = this.heard.size + 1;
      this.heard.set(name, resolve);
      // In subscribers, now and later, of this key, each as if it were to this key.
      this.send(Buffer.from([INTEREST | 0x60]), count(interest), Buffer.from([0x02 | 0x10 | 0x20 | 0x80]), key(name));
    });
  }

  close() {
    this.write(Buffer.from([CLOSE | 0x20, 0]));
    return new Promise((resolve) => this.socket.end(() => resolve(undefined)));
  }

  async listen() {
    for await (const batch of this.batches) this.read(new Reader(batch));
  }

  read(reader) {
    while (reader.more) {
      const header = reader.byte();
      switch (header & 31) {
        case FRAME:
          reader.count();
          reader.extensions(header);
          break;
        case FRAGMENT:
          reader.count();
          reader.extensions(header);
          this.fragments.push(reader.take(reader.data.length));
          if (!(header & MORE)) this.read(new Reader(Buffer.concat(this.fragments.splice(0))));
          break;
        case KEEP_ALIVE:
          break;
        case PUSH:
          this.hear(reader, header);
          break;
        case DECLARE:
          this.learn(reader, header);
          break;
        case INTEREST:
          reader.count();
          if (header & 0x60 && reader.byte() & 0x10) reader.key(NAMED);
          reader.extensions(header);
          break;
        default:
          throw new Error(`a message of kind ${header & 31}, which this client does not know`);
      }
    }
  }

  hear(reader, header) {
    reader.key(header);
    reader.extensions(header);
    const body = reader.byte();
    if ((body & 31) !== 0x01) throw new Error("no put");
    if (body & 0x20) reader.large(), reader.block(); // when, by which clock
    if (body & 0x40 && reader.count() & 1) reader.block(); // its encoding, and schema
    reader.extensions(body);
    const data = Buffer.from(reader.block());
    for (const listener of this.listeners) listener(data);
  }

  learn(reader, header) {
    if (header & 0x20) reader.count(); // in answer to which interest
    reader.extensions(header);
    const what = reader.byte();
    const kind = what & 31;
    if (kind !== 0x1a) reader.count(); // the number of what is declared, or not any more
    const name = kind % 2 === 0 && kind < 8 ? reader.key(what) : "";
    reader.extensions(what);
    if (kind === 0x02) this.heard.get(name)?.();
  }
}

async function* batches(socket) {
  let data = Buffer.alloc(0);
  for await (const chunk of socket) {
    data = Buffer.concat([data, chunk]);
    while (data.length >= 2 && data.length >= 2 + data.readUInt16LE()) {
      const end = 2 + data.readUInt16LE();
      yield data.subarray(2, end);
      data = data.subarray(end);
    }
  }
}
