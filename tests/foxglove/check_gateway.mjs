// The gateway for viewers as programs of others see it: Foxglove's own client over the package ws, protobufjs for the
// messages, and Chromium where it is installed. A simulated boat over its radio, the shore's proxy and the gateway are
// real programs.
// node check_gateway.mjs FOLDER_OF_PROGRAMS       Exits 0 only if every check held; says what was left out.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { connect } from 'node:net';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { createRequire } from 'node:module';
import { run } from '../signalk/reader.mjs';

const bin = process.argv[2];
if (!bin) {
  console.error('usage: node check_gateway.mjs FOLDER_OF_PROGRAMS');
  process.exit(2);
}
const here = dirname(fileURLToPath(import.meta.url));
const require = createRequire(import.meta.url);
const { WebSocket } = require('ws');
const { FoxgloveClient } = require('@foxglove/ws-protocol');
const protobuf = require('protobufjs');
const { FileDescriptorSet } = require('protobufjs/ext/descriptor');

const work = mkdtempSync(join(tmpdir(), 'ise-foxglove.'));
const programs = [];
const start = (command, args, options) => { const made = run(spawn, command, args, options); programs.push(made); return made; };
const pause = ms => new Promise(resolve => setTimeout(resolve, ms));
/** Asks until it gives something, for two minutes: the machine may be busy. */
async function until(what, ask) {
  const end = Date.now() + 120_000;
  for (let last; ; await pause(50)) {
    try { const got = await ask(); if (got) return got; } catch (why) { last = why; }
    if (Date.now() > end) throw new Error(`it did not come to this: ${what}${last ? ` (${last.message})` : ''}`);
  }
}
let failed = 0, passed = 0;
const left_out = [];
const check = async (name, body) => {
  try { await body(); console.log(`ok    ${name}`); ++passed; }
  catch (why) { ++failed; console.log(`FAIL  ${name}\n      ${String(why.stack).split('\n').slice(0, 25).join('\n      ')}`); }
};

/** A viewer by Foxglove's client: everything it was told. */
class Viewer {
  channels = new Map(); services = new Map(); messages = new Map(); statuses = []; parameters = []; failures = [];
  responses = []; graphs = []; assets = []; removed = [];
  constructor(url, protocol = FoxgloveClient.SUPPORTED_SUBPROTOCOL) {
    this.socket = new WebSocket(url, [protocol]);
    this.client = new FoxgloveClient({ ws: this.socket });
    const on = (event, take) => this.client.on(event, take);
    on('serverInfo', info => { this.info = info; });
    on('advertise', all => all.forEach(one => this.channels.set(one.topic, one)));
    on('unadvertise', ids => { for (const [topic, one] of this.channels) if (ids.includes(one.id)) { this.channels.delete(topic); this.removed.push(topic); } });
    on('advertiseServices', all => all.forEach(one => this.services.set(one.name, one)));
    on('message', ({ subscriptionId, timestamp, data }) => this.messages.get(subscriptionId)?.push({ timestamp, data }));
    on('status', one => this.statuses.push(one));
    on('parameterValues', one => this.parameters.push(one));
    on('serviceCallResponse', one => this.responses.push(one));
    on('serviceCallFailure', one => this.failures.push(one));
    on('connectionGraphUpdate', one => this.graphs.push(one));
    on('fetchAssetResponse', one => this.assets.push(one));
    on('error', why => { this.error = why; });
  }
  async channel(topic) { return until(`the channel ${topic}`, () => this.channels.get(topic)); }
  /** Subscribes; gives a function that waits for the next message, decoded. */
  async subscribe(topic) {
    const channel = await this.channel(topic);
    const type = type_of(channel.schemaName, channel.schema);
    const id = this.client.subscribe(channel.id), got = [];
    this.messages.set(id, got);
    return async () => {
      await until(`a message of ${topic}`, () => got.length > 0);
      const { timestamp, data } = got.shift();
      return { timestamp, message: type.toObject(type.decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength)), { longs: Number, enums: String }) };
    };
  }
  close() { this.client.close(); }
}
function type_of(name, schema) {
  const root = protobuf.Root.fromDescriptor(FileDescriptorSet.decode(Buffer.from(schema, 'base64')));
  root.resolveAll();
  return root.lookupType(name);
}
/** Sends bytes, gives what was answered until the connection ended. */
const raw = (port, text) => new Promise((resolve, reject) => {
  let all = '';
  const socket = connect(port, '127.0.0.1', () => socket.end(text));
  socket.on('data', piece => { all += piece.toString('latin1'); });
  socket.on('close', () => resolve(all));
  socket.on('error', reject);
});
const refused = (url, protocols, options) => new Promise((resolve, reject) => {
  const socket = new WebSocket(url, protocols, options);
  socket.on('unexpected-response', (_, answer) => { let text = ''; answer.on('data', piece => { text += piece; }); answer.on('end', () => resolve({ status: answer.statusCode, text })); });
  socket.on('open', () => { socket.close(); reject(new Error('it was let in')); });
  socket.on('error', () => {});
});

// El Confital: where the simulated boat sails.
const in_the_bay = (latitude, longitude) => latitude > 28.13 && latitude < 28.18 && longitude > -15.48 && longitude < -15.43;

try {
  const names = start(join(bin, 'ise_name_server'), ['--listen', 'tcp://127.0.0.1:0', '--fresh']);
  const env = { ...process.env, ISE_NAME_SERVER: (await names.says(/tcp:\/\/\S+/))[0] };
  const atirma = (...args) => start(join(bin, 'atirma'), ['run', ...args], { env });
  await atirma('xbee-link', '--shore-port', join(work, 'shore'), '--boat-port', join(work, 'boat')).says(/started/);
  atirma('boat-simulator', '--serial', join(work, 'boat'));
  let proxy = atirma('xbee-proxy', '--serial', join(work, 'shore'));
  mkdirSync(join(work, 'assets'));
  writeFileSync(join(work, 'assets', 'hull.glb'), 'a hull');
  writeFileSync(join(work, 'secret'), 'a secret');
  const url_of = async gateway => (await gateway.says(/ready: (ws:\S+)/))[1];
  const open = await url_of(atirma('foxglove-boat', '--port', '0', '--allow-calls', '--allow-parameters',
    '--allow-publish', '--assets', join(work, 'assets')));
  const closed = await url_of(start(join(bin, 'ise_foxglove_gateway'), ['run', 'foxglove-gateway', '--port=0', '--path=ise/closed'], { env }));
  const viewer = new Viewer(open);

  await check('a viewer is told what the gateway can do', async () => {
    await until('server info', () => viewer.info);
    assert.match(viewer.info.name, /atirma\/foxglove/);
    assert.deepEqual([...viewer.info.capabilities].sort(), ['assets', 'clientPublish', 'connectionGraph', 'parameters', 'parametersSubscribe', 'services']);
    assert.deepEqual(viewer.info.supportedEncodings, ['protobuf', 'json']);
    assert.match(viewer.info.sessionId, /^[0-9a-f]{16}$/);
  });
  await check('packets are read by their descriptors, with the time of their publication', async () => {
    const next = await viewer.subscribe('atirma/shore/xbee/telemetry');
    const { timestamp, message } = await next();
    assert.ok(Math.abs(Number(timestamp) / 1e6 - Date.now()) < 60_000, String(timestamp));
    assert.ok(message.raw.length > 10);
  });
  await check('the boat is a LocationFix, a FrameTransform and a GeoJSON line', async () => {
    const [fix, attitude, wind, track] = await Promise.all(['fix', 'attitude', 'wind_frame', 'track'].map(one => viewer.subscribe(`atirma/shore/xbee/${one}`)));
    assert.equal((await viewer.channel('atirma/shore/xbee/fix')).schemaName, 'foxglove.LocationFix');
    const place = (await fix()).message;
    assert.ok(in_the_bay(place.latitude, place.longitude), JSON.stringify(place));
    const { message: frame } = await attitude();
    assert.deepEqual([frame.parent_frame_id, frame.child_frame_id], ['map', 'boat']);
    const { x, y, z, w } = frame.rotation;
    assert.ok(Math.abs(Math.hypot(x, y, z, w) - 1) < 1e-9);
    assert.equal((await wind()).message.child_frame_id, 'wind');
    const line = JSON.parse((await track()).message.geojson);
    assert.equal(line.geometry.type, 'LineString');
    assert.ok(in_the_bay(line.geometry.coordinates[0][1], line.geometry.coordinates[0][0]));
  });
  await check('reports are there field by field', async () => {
    const { message } = await (await viewer.subscribe('atirma/shore/xbee/wind'))();
    assert.ok(message.true_speed_mps > 0 && message.true_speed_mps < 60, JSON.stringify(message));
  });
  await check('a service is called with protobuf and with JSON', async () => {
    const service = await until('the service', () => viewer.services.get('atirma/boat/scene'));
    assert.equal(service.request.encoding, 'protobuf');
    const request = type_of(service.request.schemaName, service.request.schema);
    const response = type_of(service.response.schemaName, service.response.schema);
    const asked = request.encode(request.create({ wind_speed_mps: 7.5 })).finish();
    viewer.client.sendServiceCallRequest({ serviceId: service.id, callId: 1, encoding: 'protobuf', data: new DataView(asked.buffer, asked.byteOffset, asked.byteLength) });
    const answer = await until('an answer', () => viewer.responses.find(one => one.callId === 1));
    const { data } = answer;
    assert.equal(response.decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength)).wind_speed_mps, 7.5);
    const json = text => { const bytes = Buffer.from(text); return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength); };
    viewer.client.sendServiceCallRequest({ serviceId: service.id, callId: 2, encoding: 'json', data: json('{}') });
    const second = await until('an answer', () => viewer.responses.find(one => one.callId === 2));
    assert.equal(JSON.parse(Buffer.from(second.data.buffer, second.data.byteOffset, second.data.byteLength).toString()).wind_speed_mps, 7.5);
    viewer.client.sendServiceCallRequest({ serviceId: service.id, callId: 3, encoding: 'json', data: json('{"wind":1}') });
    const failure = await until('a failure', () => viewer.failures.find(one => one.callId === 3));
    assert.match(failure.message, /wind/);
  });
  await check('parameters are read, set and followed', async () => {
    viewer.client.subscribeParameterUpdates(['atirma/boat/wind-speed']);
    viewer.client.getParameters(['atirma/boat/wind-speed'], 'g');
    await until('the value', () => viewer.parameters.find(one => one.id === 'g' && one.parameters.length === 1));
    viewer.client.setParameters([{ name: 'atirma/boat/wind-speed', value: 9 }], 's');
    const set = await until('the new value', () => viewer.parameters.find(one => one.id === 's'));
    assert.deepEqual(set.parameters.map(one => [one.name, one.value]), [['atirma/boat/wind-speed', 9]]);
    await until('the update', () => viewer.parameters.find(one => !one.id && one.parameters.some(p => p.value === 9)));
    viewer.client.setParameters([{ name: 'atirma/boat/wind-speed', value: 900 }], 't');
    await until('the refusal', () => viewer.statuses.find(one => one.level === 2 && /wind-speed/.test(one.message)));
  });
  await check('the graph tells who publishes and who listens', async () => {
    viewer.client.subscribeConnectionGraph();
    await until('the graph', () => viewer.graphs.find(one => one.publishedTopics.some(topic => topic.name === 'atirma/shore/xbee/telemetry' && topic.publisherIds.includes('atirma/shore/xbee'))));
    await until('a subscriber', () => viewer.graphs.find(one => one.subscribedTopics.some(topic => topic.name === 'atirma/boat/ground_truth' && topic.subscriberIds.includes('atirma/air'))));
  });
  await check('assets come from their folder and from nowhere else', async () => {
    const fetch = (uri, id) => { viewer.client.fetchAsset(uri, id); return until(uri, () => viewer.assets.find(one => one.requestId === id)); };
    const hull = await fetch('package://hull.glb', 1);
    assert.equal(Buffer.from(hull.data.buffer, hull.data.byteOffset, hull.data.byteLength).toString(), 'a hull');
    for (const [n, uri] of ['package://../secret', 'package://%2e%2e/secret', 'file:///etc/passwd', 'package://x/../../secret', 'package://hull.glb%00', 'hull.glb', 'package://none'].entries()) {
      const answer = await fetch(uri, 10 + n);
      assert.equal(answer.status, 1, uri);
      assert.ok(answer.error.length > 10, uri);
    }
  });
  await check('what a viewer publishes reaches ISE', async () => {
    const echo = start(join(bin, 'ise'), ['echo', 'atirma/foxglove', 'published'], { env });
    const id = viewer.client.advertise({ topic: 'goal', encoding: 'json', schemaName: 'goal' });
    const line = echo.says(/"topic":"goal".*/);
    let done = false;
    line.then(() => { done = true; }, () => { done = true; });
    while (!done) { viewer.client.sendMessage(id, Buffer.from('{"latitude":28.1}')); await pause(200); }
    assert.match((await line)[0], /latitude/);
    await echo.stop();
  });
  await check('a component that goes takes its channels along, and brings them back under the same number', async () => {
    const { id } = await viewer.channel('atirma/shore/xbee/telemetry');
    await proxy.stop();
    await until('the end', () => viewer.removed.includes('atirma/shore/xbee/telemetry'));
    proxy = atirma('xbee-proxy', '--serial', join(work, 'shore'));
    assert.equal((await viewer.channel('atirma/shore/xbee/telemetry')).id, id);
    await (await viewer.subscribe('atirma/shore/xbee/telemetry'))();
  });
  await check('by default a viewer looks only', async () => {
    const looks = new Viewer(closed, 'foxglove.sdk.v1');
    await looks.channel('atirma/shore/xbee/telemetry');
    assert.equal(looks.socket.protocol, 'foxglove.sdk.v1');
    assert.deepEqual([...looks.info.capabilities].sort(), ['connectionGraph', 'parameters', 'parametersSubscribe']);
    assert.equal(looks.services.size, 0);
    looks.client.setParameters([{ name: 'atirma/boat/wind-speed', value: 1 }], 'no');
    await until('a refusal', () => looks.statuses.find(one => /--allow-parameters/.test(one.message)));
    looks.client.advertise({ topic: 'goal', encoding: 'json', schemaName: 'goal' });
    await until('a refusal', () => looks.statuses.find(one => /--allow-publish/.test(one.message)));
    looks.client.sendServiceCallRequest({ serviceId: 1, callId: 1, encoding: 'json', data: new DataView(new ArrayBuffer(0)) });
    await until('a failure', () => looks.failures.find(one => /--allow-calls/.test(one.message)));
    looks.close();
  });
  await check('what the access policy refuses to the gateway, viewers are told', async () => {
    const policy = join(work, 'access.toml');
    writeFileSync(policy, `version = 1
[[allow]]
who = ["nobody", "unix:*"]
name = ["**"]
read = ["**"]
[[deny]]
who = ["nobody", "unix:*"]
subscribe = ["atirma/nmea:bridge"]
`, { mode: 0o600 });
    start(join(bin, 'atirma'), ['run', 'nmea-bridge', '--nmea-tcp', '', '--signalk-tcp', ''], { env: { ...env, ISE_ACCESS: policy } });
    const { id } = await viewer.channel('atirma/nmea/bridge');
    viewer.client.subscribe(id);
    const told = await until('a status', () => viewer.statuses.find(one => one.id === 'subscription:atirma/nmea/bridge'));
    assert.equal(told.level, 2);
    assert.match(told.message, /may not subscribe/);
  });
  await check('who does not belong here is not let in', async () => {
    assert.equal((await refused(open, ['foxglove.websocket.v1'], { origin: 'https://evil.example' })).status, 403);
    const none = await refused(open, ['chat']);
    assert.equal(none.status, 400);
    assert.match(none.text, /foxglove\.sdk\.v1/);
    const { port } = new URL(open);
    assert.match(await raw(port, 'GET / HTTP/1.1\r\nHost: x\r\n\r\n'), /^HTTP\/1\.1 426 /);
    const allowed = new WebSocket(open, ['foxglove.websocket.v1'], { origin: 'https://app.foxglove.dev' });
    await new Promise((resolve, reject) => { allowed.on('open', resolve); allowed.on('error', reject); });
    allowed.close();
  });
  await check('nonsense is answered, and the viewer stays', async () => {
    const wild = new Viewer(open);
    await until('server info', () => wild.info);
    for (const text of ['', '{', '[]', '{"op":7}', '{"op":"dance"}', '{"op":"subscribe"}', '{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1e99}]}']) wild.socket.send(text);
    wild.socket.send(Buffer.from([1]));
    wild.socket.send(Buffer.from([2, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255]));
    wild.socket.send(Buffer.from([99]));
    await until('ten errors', () => wild.statuses.filter(one => one.level === 2).length === 10);
    await (await wild.subscribe('atirma/shore/xbee/telemetry'))();
    const closing = new Promise(resolve => wild.socket.on('close', code => resolve(code)));
    wild.socket.send('x'.repeat(2_000_000));
    assert.equal(await closing, 1009);
  });

  const chromium = process.env.CHROMIUM ?? '/usr/bin/chromium';
  const driver = join(here, '..', 'web', 'node_modules', 'playwright-core', 'index.mjs');
  if (existsSync(chromium) && existsSync(driver)) {
    await check('a page of this host sees messages in Chromium', async () => {
      const page_server = createServer((_, answer) => { answer.setHeader('Content-Type', 'text/html'); answer.end('<p>viewer</p>'); }).listen(0, '127.0.0.1');
      await new Promise(resolve => page_server.on('listening', resolve));
      const { chromium: engine } = await import(pathToFileURL(driver));
      const browser = await engine.launch({ executablePath: chromium, args: ['--no-sandbox', '--disable-gpu', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'] });
      try {
        const page = await browser.newPage();
        page.setDefaultTimeout(120_000);
        await page.goto(`http://127.0.0.1:${page_server.address().port}/`);
        const got = await page.evaluate(url => new Promise((resolve, reject) => {
          const socket = new WebSocket(url, ['foxglove.sdk.v1', 'foxglove.websocket.v1']);
          socket.binaryType = 'arraybuffer';
          socket.onerror = () => reject(new Error('no connection'));
          socket.onmessage = ({ data }) => {
            if (typeof data === 'string') {
              const told = JSON.parse(data);
              const found = told.op === 'advertise' && told.channels.find(one => one.topic === 'atirma/shore/xbee/telemetry');
              if (found) socket.send(JSON.stringify({ op: 'subscribe', subscriptions: [{ id: 5, channelId: found.id }] }));
            } else {
              const view = new DataView(data);
              resolve({ protocol: socket.protocol, opcode: view.getUint8(0), id: view.getUint32(1, true), size: data.byteLength });
            }
          };
        }), open);
        assert.equal(got.protocol, 'foxglove.sdk.v1');
        assert.deepEqual([got.opcode, got.id], [1, 5]);
        assert.ok(got.size > 30);
      } finally {
        await browser.close();
        page_server.close();
      }
    });
  } else left_out.push('Chromium: it is not installed, or `npm ci` was not run in tests/web');
  viewer.close();
} finally {
  for (const one of programs.reverse()) await one.stop();
  rmSync(work, { recursive: true, force: true });
}
for (const one of left_out) console.log(`left out  ${one}`);
console.log(`${passed} passed, ${failed} failed`);
process.exit(failed ? 1 : 0);
