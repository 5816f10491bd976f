// Recordings as programs of others see them: @mcap/core reads a file of ours, protobufjs its packets by the descriptors
// in it; what these two write, ours reads.
// node check_mcap.mjs MCAP_CONFORMANCE       Exits 0 only if every check held. Needs `npm ci` here.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

const program = process.argv[2];
if (!program) {
  console.error('usage: node check_mcap.mjs MCAP_CONFORMANCE');
  process.exit(2);
}
const require = createRequire(import.meta.url);
const { McapIndexedReader, McapWriter, TempBuffer } = require('@mcap/core');
const protobuf = require('protobufjs');
const descriptor = require('protobufjs/ext/descriptor');
const fzstd = require('fzstd');
const work = mkdtempSync(join(tmpdir(), 'ise-mcap.'));
const run = (...args) => execFileSync(program, args, { encoding: 'utf8' });

/** The message type of a schema record. */
function type_of(schema) {
  const set = descriptor.FileDescriptorSet.decode(schema.data);
  return protobuf.Root.fromDescriptor(set).lookupType(schema.name);
}
class Bytes {
  constructor(data) { this.data = data; }
  async size() { return BigInt(this.data.length); }
  async read(offset, size) { return this.data.subarray(Number(offset), Number(offset + size)); }
}
async function messages_of(data) {
  const reader = await McapIndexedReader.Initialize({
    readable: new Bytes(data), decompressHandlers: { zstd: (part, size) => fzstd.decompress(part, new Uint8Array(Number(size))) },
  });
  const all = [];
  for await (const message of reader.readMessages()) all.push(message);
  return { reader, all };
}

let failed = 0;
const check = async (name, body) => {
  try { await body(); console.log(`ok    ${name}`); }
  catch (why) { ++failed; console.log(`FAIL  ${name}\n      ${String(why.stack).split('\n').slice(0, 25).join('\n      ')}`); }
};

try {
  const ours = join(work, 'ours.mcap');
  const expected = run('sample', ours).trim().split('\n').map(line => JSON.parse(line));
  const { reader, all } = await messages_of(readFileSync(ours));
  const schema = [...reader.schemasById.values()][0];
  const type = type_of(schema);
  const shown = message => type.toObject(type.decode(message.data), { longs: String, enums: String, defaults: true, oneofs: true });

  await check('@mcap/core reads a compressed file of ours by its index', async () => {
    assert.equal(reader.header.profile, 'ise');
    assert.equal(reader.statistics.messageCount, BigInt(expected.length));
    assert.equal(all.length, expected.length);
    assert.deepEqual(all.map(one => one.sequence), all.map((_, i) => i));
    assert.equal([...reader.channelsById.values()][0].messageEncoding, 'protobuf');
    const attached = [];
    for await (const one of reader.readAttachments()) attached.push(one);
    assert.equal(new TextDecoder().decode(attached[0].data), '[deployment]');
  });

  await check('protobufjs reads its packets by the descriptors in it', async () => {
    all.forEach((message, i) => {
      const got = shown(message), wanted = expected[i];
      assert.equal(got.name, wanted.name);
      assert.equal(got.count, wanted.count);
      assert.equal(got.big, String(wanted.big));
      assert.equal(got.ratio, wanted.ratio);
      assert.equal(got.sails, wanted.sails);
      assert.deepEqual(got.route, wanted.route);
      // A map is a repeated entry on the wire, and protobufjs shows those of a descriptor as that.
      const named = Array.isArray(got.named) ? Object.fromEntries(got.named.map(one => [one.key, one.value])) : got.named;
      assert.deepEqual(named, wanted.named);
      assert.equal(got.maybe ?? null, wanted.maybe);
      assert.equal(Buffer.from(got.blob).toString('base64'), wanted.blob);
      assert.equal(new Date(Number(got.when.seconds) * 1000 + got.when.nanos / 1e6).toISOString(), new Date(wanted.when).toISOString());
      assert.equal(got.any.value, ['i32', 'string'][wanted.any.index] === 'i32' ? 'alternative_0' : 'alternative_1');
      assert.equal(got.any[got.any.value], wanted.any.value);
    });
  });

  await check('what @mcap/core and protobufjs write, ours reads', async () => {
    const buffer = new TempBuffer();
    const writer = new McapWriter({ writable: buffer });
    await writer.start({ profile: '', library: 'others' });
    const schemaId = await writer.registerSchema({ name: schema.name, encoding: 'protobuf', data: schema.data });
    const channelId = await writer.registerChannel({ schemaId, topic: 'sample', messageEncoding: 'protobuf', metadata: new Map() });
    for (const message of all) {
      // Decoded and encoded anew, so that none of ISE's own bytes are left.
      const data = type.encode(type.fromObject(type.toObject(type.decode(message.data)))).finish();
      await writer.addMessage({ channelId, sequence: message.sequence, logTime: message.logTime, publishTime: message.publishTime, data });
    }
    await writer.end();
    const theirs = join(work, 'theirs.mcap');
    writeFileSync(theirs, buffer.get());
    const got = run('packets', theirs).trim().split('\n').map(line => JSON.parse(line));
    assert.deepEqual(got, expected);
  });
} finally {
  rmSync(work, { recursive: true, force: true });
}
process.exit(failed ? 1 : 0);
