// Reads a log with @mcap/core and prints what it found as one JSON object.
// node read.mjs indexed|stream FILE
import { createHash } from "node:crypto";
import { open, readFile } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const [mode, path] = process.argv.slice(2);

function describe(topic, message) {
  return {
    topic,
    sequence: message.sequence,
    log_time: String(message.logTime),
    publish_time: String(message.publishTime),
    sha256: createHash("sha256").update(message.data).digest("hex"),
  };
}

async function indexed() {
  const file = await open(path);
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const buffer = new Uint8Array(Number(length));
      const { bytesRead } = await file.read(buffer, 0, Number(length), Number(offset));
      if (bytesRead !== Number(length)) throw new Error(`only ${bytesRead} of ${length} bytes at ${offset}`);
      return buffer;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const messages = [];
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    messages.push(describe(reader.channelsById.get(message.channelId).topic, message));
  }
  const metadata = [];
  for await (const record of reader.readMetadata()) metadata.push([record.name, Object.fromEntries(record.metadata)]);
  const attachments = [];
  for await (const record of reader.readAttachments()) attachments.push([record.name, Buffer.from(record.data).toString()]);
  await file.close();
  const counts = reader.statistics.channelMessageCounts;
  return {
    profile: reader.header.profile,
    chunks: reader.statistics.chunkCount,
    counts: Object.fromEntries([...counts].map(([id, n]) => [reader.channelsById.get(id).topic, Number(n)])),
    messages,
    metadata,
    attachments,
  };
}

async function stream() {
  const reader = new McapStreamReader({ validateCrcs: true });
  const channels = new Map();
  const messages = [];
  const profiles = [];
  reader.append(await readFile(path));
  for (let record; (record = reader.nextRecord()) !== undefined; ) {
    if (record.type === "Header") profiles.push(record.profile);
    else if (record.type === "Channel") channels.set(record.id, record.topic);
    else if (record.type === "Message") messages.push(describe(channels.get(record.channelId), record));
  }
  return { profile: profiles[0], done: reader.done(), messages };
}

console.log(JSON.stringify(await (mode === "indexed" ? indexed() : stream())));
