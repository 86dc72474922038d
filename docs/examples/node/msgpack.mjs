// As much of MessagePack as an agent needs: nil, truths, numbers, texts, bytes, lists and maps.

const FLOAT = Symbol("float");

// A number that travels as a double, whole or not.
export const float = (value) => ({ [FLOAT]: value });

export function pack(value) {
  if (value === null) return Buffer.from([0xc0]);
  if (typeof value === "boolean") return Buffer.from([value ? 0xc3 : 0xc2]);
  if (typeof value === "number") return Number.isInteger(value) ? whole(value) : double(value);
  if (typeof value === "string") return Buffer.concat([headed(0xdb, Buffer.byteLength(value)), Buffer.from(value)]);
  if (Buffer.isBuffer(value)) return Buffer.concat([headed(0xc6, value.length), value]);
  if (Array.isArray(value)) return Buffer.concat([headed(0xdd, value.length), ...value.map(pack)]);
  if (FLOAT in value) return double(value[FLOAT]);
  const entries = Object.entries(value);
  return Buffer.concat([headed(0xdf, entries.length), ...entries.flat().map(pack)]);
}

function headed(kind, length) {
  const head = Buffer.alloc(5, kind);
  head.writeUInt32BE(length, 1);
  return head;
}

function whole(value) {
  const data = Buffer.alloc(9, 0xd3);
  data.writeBigInt64BE(BigInt(value), 1);
  return data;
}

function double(value) {
  const data = Buffer.alloc(9, 0xcb);
  data.writeDoubleBE(value, 1);
  return data;
}

export function unpack(data) {
  const { value, end } = read(data, 0);
  if (end !== data.length) throw new Error("bytes after the message");
  return value;
}

function read(data, at) {
  const head = data[at++];
  const number = (size, how) => ({ value: Number(data[how](at)), end: at + size });
  const bytes = (size, from) => {
    if (from + size > data.length) throw new Error("the message breaks off");
    return { value: data.subarray(from, from + size), end: from + size };
  };
  const text = (size, from) => ({ ...bytes(size, from), value: bytes(size, from).value.toString() });
  const list = (size, end) => {
    const value = [];
    for (let n = 0; n < size; n++) ({ value: value[n], end } = read(data, end));
    return { value, end };
  };
  const map = (size, from) => {
    const { value, end } = list(2 * size, from);
    return { value: Object.fromEntries(value.flatMap((k, n) => (n % 2 ? [] : [[k, value[n + 1]]]))), end };
  };
  const long = (how, sizes, first) => {
    const width = sizes[head - first];
    return how(data.readUIntBE(at, width), at + width);
  };
  if (head < 0x80) return { value: head, end: at };
  if (head < 0x90) return map(head & 15, at);
  if (head < 0xa0) return list(head & 15, at);
  if (head < 0xc0) return text(head & 31, at);
  if (head >= 0xe0) return { value: head - 256, end: at };
  if (head === 0xc0) return { value: null, end: at };
  if (head === 0xc2 || head === 0xc3) return { value: head === 0xc3, end: at };
  if (head >= 0xc4 && head <= 0xc6) return long(bytes, [1, 2, 4], 0xc4);
  if (head === 0xca) return number(4, "readFloatBE");
  if (head === 0xcb) return number(8, "readDoubleBE");
  if (head >= 0xcc && head <= 0xcf)
    return number(2 ** (head - 0xcc), ["readUInt8", "readUInt16BE", "readUInt32BE", "readBigUInt64BE"][head - 0xcc]);
  if (head >= 0xd0 && head <= 0xd3)
    return number(2 ** (head - 0xd0), ["readInt8", "readInt16BE", "readInt32BE", "readBigInt64BE"][head - 0xd0]);
  if (head >= 0xd9 && head <= 0xdb) return long(text, [1, 2, 4], 0xd9);
  if (head >= 0xdc && head <= 0xdd) return long(list, [2, 4], 0xdc);
  if (head >= 0xde && head <= 0xdf) return long(map, [2, 4], 0xde);
  throw new Error(`no MessagePack: ${head}`);
}
