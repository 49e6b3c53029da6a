// Reads an MCAP log with the reference TypeScript library and prints what it finds as JSON, for comparison with Python.
//
//   node read_mcap.mjs LOG.mcap TOPIC...
//
// Output: one object {library, statistics, metadata, attachments, topics}. topics[T] = {count, schema, rows}; rows only
// for the topics named, each row an object of its fields. Every number is printed as the 16 hex digits of its float64,
// so that a comparison is bitwise (JSON has no NaN and no -0).

import { open } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import Lz4 from "@foxglove/wasm-lz4";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

/** A file as @mcap/core wants it. */
class FileReadable {
  constructor(handle) {
    this.handle = handle;
  }
  async size() {
    return BigInt((await this.handle.stat()).size);
  }
  async read(offset, length) {
    const buffer = new Uint8Array(Number(length));
    const { bytesRead } = await this.handle.read(buffer, 0, Number(length), Number(offset));
    if (bytesRead !== Number(length)) {
      throw new Error(`expected ${length} bytes at ${offset}, got ${bytesRead}`);
    }
    return buffer;
  }
}

function bits(number) {
  const view = new DataView(new ArrayBuffer(8));
  view.setFloat64(0, number);
  return view.getBigUint64(0).toString(16).padStart(16, "0");
}

function printable(value) {
  if (typeof value === "number") return bits(value);
  if (typeof value === "bigint") return bits(Number(value));
  if (typeof value === "string" || typeof value === "boolean" || value == undefined) return value;
  if (ArrayBuffer.isView(value) || Array.isArray(value)) return Array.from(value, printable);
  if (protobuf.util.Long.isLong(value)) return bits(value.toNumber());
  return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, printable(item)]));
}

function decoderOf(channel, schema) {
  if (channel.messageEncoding === "cdr" && schema.encoding === "ros2msg") {
    const reader = new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true }));
    return (data) => reader.readMessage(data);
  }
  if (channel.messageEncoding === "protobuf" && schema.encoding === "protobuf") {
    const files = descriptor.FileDescriptorSet.decode(schema.data);
    const type = protobuf.Root.fromDescriptor(files).lookupType(schema.name);
    return (data) => type.toObject(type.decode(data), { defaults: true });
  }
  throw new Error(`${channel.topic}: unknown encoding ${channel.messageEncoding} with schema ${schema.encoding}`);
}

async function main([path, ...wanted]) {
  await Lz4.isLoaded;
  const handle = await open(path, "r");
  try {
    process.stdout.write(JSON.stringify(await contentOf(handle, wanted)) + "\n");
  } finally {
    await handle.close();
  }
}

async function contentOf(handle, wanted) {
  const reader = await McapIndexedReader.Initialize({
    readable: new FileReadable(handle),
    decompressHandlers: { lz4: (buffer, size) => Lz4(buffer, Number(size)) },
  });
  const topics = {};
  const decoders = new Map();
  for (const channel of reader.channelsById.values()) {
    const schema = reader.schemasById.get(channel.schemaId);
    if (schema == undefined) throw new Error(`${channel.topic}: a channel without schema`);
    decoders.set(channel.id, decoderOf(channel, schema));
    topics[channel.topic] = { count: 0, schema: schema.name, encoding: channel.messageEncoding, rows: [] };
  }
  let last = -1n;
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    if (message.logTime < last) throw new Error(`log time goes back to ${message.logTime}`);
    if (message.logTime !== message.publishTime) throw new Error("log time and publish time differ");
    last = message.logTime;
    const topic = topics[reader.channelsById.get(message.channelId).topic];
    topic.count += 1;
    const row = decoders.get(message.channelId)(message.data); // every message is decoded, whether asked for or not
    if (wanted.includes(reader.channelsById.get(message.channelId).topic)) {
      topic.rows.push({ log_time: bits(Number(message.logTime)), ...printable(row) });
    }
  }
  const metadata = {};
  for await (const record of reader.readMetadata()) metadata[record.name] = Object.fromEntries(record.metadata);
  const attachments = {};
  for await (const record of reader.readAttachments({ validateCrcs: true })) {
    attachments[record.name] = new TextDecoder().decode(record.data);
  }
  const statistics = {
    messages: Number(reader.statistics.messageCount),
    channels: reader.statistics.channelCount,
    chunks: reader.statistics.chunkCount,
  };
  const library = reader.header.library;
  return { library, statistics, metadata, attachments, topics };
}

main(process.argv.slice(2)).catch((error) => {
  process.stderr.write(`${error.message ?? error}\n`);
  process.exitCode = 1;
});
