// A simulated boat over its radio, the shore's proxy and the NMEA bridge, as real programs: a strict reader checks every
// line that the bridge says, over TCP and UDP; gpsd shows the boat (where it is installed); and so does signalk-server
// (after `npm ci` here, as tests/run does), once fed with Signal K deltas and once with NMEA 0183.
// node check_signalk.mjs FOLDER_OF_PROGRAMS       Exits 0 only if every check held; says what was left out.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createSocket } from 'node:dgram';
import { existsSync, mkdtempSync, mkdirSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { lines_of, read_delta, read_hello, read_sentence, run } from './reader.mjs';

const bin = process.argv[2];
if (!bin) {
  console.error('usage: node check_signalk.mjs FOLDER_OF_PROGRAMS');
  process.exit(2);
}
const here = dirname(fileURLToPath(import.meta.url));
const work = mkdtempSync(join(tmpdir(), 'atirma-signalk.'));
const programs = [];
const start = (command, args, options) => { const made = run(spawn, command, args, options); programs.push(made); return made; };
const pause = ms => new Promise(resolve => setTimeout(resolve, ms));
/** Asks until it gives something, for two minutes: the machine may be busy. */
async function until(what, ask) {
  const end = Date.now() + 120_000;
  for (let last; ; await pause(200)) {
    try { const got = await ask(); if (got) return got; } catch (why) { last = why; }
    if (Date.now() > end) throw new Error(`it did not come to this: ${what}${last ? ` (${last.message})` : ''}`);
  }
}
const free_port = () => new Promise(resolve => { const s = createServer().listen(0, '127.0.0.1', () => { const { port } = s.address(); s.close(() => resolve(port)); }); });

let failed = 0, passed = 0;
const left_out = [];
const check = async (name, body) => {
  try { await body(); console.log(`ok    ${name}`); ++passed; }
  catch (why) { ++failed; console.log(`FAIL  ${name}\n      ${String(why.message).split('\n').slice(0, 25).join('\n      ')}`); }
};

// El Confital: where the simulated boat sails.
const in_the_bay = at => at.latitude > 28.13 && at.latitude < 28.18 && at.longitude > -15.48 && at.longitude < -15.43;

const datagrams = [];
const socket = createSocket('udp4');
socket.on('message', message => { if (datagrams.length < 1000) datagrams.push(message.toString('latin1')); });
await new Promise(resolve => socket.bind(0, '127.0.0.1', resolve));

try {
  const names = start(join(bin, 'ise_name_server'), ['--listen', 'tcp://127.0.0.1:0', '--fresh']);
  const env = { ...process.env, ISE_NAME_SERVER: (await names.says(/tcp:\/\/\S+/))[0] };
  const atirma = (...args) => start(join(bin, 'atirma'), ['run', ...args], { env });
  await atirma('xbee-link', '--shore-port', join(work, 'shore'), '--boat-port', join(work, 'boat')).says(/started/);
  atirma('boat-simulator', '--serial', join(work, 'boat'));
  atirma('xbee-proxy', '--serial', join(work, 'shore'));
  const nmea = await free_port(), deltas = await free_port(), gps = await free_port();
  const bridge = atirma('nmea-bridge', '--nmea-tcp', `tcp://127.0.0.1:${nmea}`, '--signalk-tcp', `tcp://127.0.0.1:${deltas}`,
    '--nmea-udp', `udp://127.0.0.1:${socket.address().port}`, '--vessel-name', 'Tirma');
  await bridge.says(new RegExp(`ready: .*:${deltas}`));

  await check('every delta over TCP is one that a strict reader takes: hello first, then all that the boat tells', async () => {
    const wanted = new Set(['', 'navigation.headingTrue', 'steering.rudderAngle', 'environment.wind.speedApparent',
      'environment.wind.directionTrue', 'electrical.batteries.main.voltage', 'communication.links.xbee.up']);
    let first = true, place;
    const end = Date.now() + 240_000;
    for await (const line of lines_of('127.0.0.1', deltas)) {
      if (first) { read_hello(line); first = false; continue; }
      for (const [path, value] of read_delta(line)) {
        wanted.delete(path);
        if (path === 'navigation.position' && value) place = value;
      }
      if (place && wanted.size === 0) break;
      assert.ok(Date.now() < end, `not told: ${[...wanted].join(', ')}`);
    }
    assert.ok(in_the_bay(place), JSON.stringify(place));
  });

  await check('every sentence over TCP and UDP has its checksum, its talker and its fields', async () => {
    const kinds = new Set(['GPRMC', 'GPGGA', 'GPVTG', 'IIHDT', 'IIRSA', 'IIXDR', 'IIMWV']);
    const missing = new Set(kinds);
    const look = line => {
      const { talker, kind } = read_sentence(line);
      assert.ok(kinds.has(talker + kind), `who asked for ${talker}${kind}?`);
      missing.delete(talker + kind);
    };
    const end = Date.now() + 120_000;
    for await (const line of lines_of('127.0.0.1', nmea)) {
      look(line);
      if (missing.size === 0) break;
      assert.ok(Date.now() < end, `not told: ${[...missing].join(', ')}`);
    }
    await until('datagrams', () => datagrams.length > 2);
    for (const one of datagrams) {
      assert.ok(one.endsWith('\r\n'));
      one.slice(0, -1).split('\n').forEach(look);
    }
  });

  if (existsSync('/usr/sbin/gpsd') && existsSync('/usr/bin/gpspipe')) {
    await check('gpsd shows the boat', async () => {
      start('/usr/sbin/gpsd', ['-N', '-n', '-S', String(gps), `tcp://127.0.0.1:${nmea}`]);
      const fix = await until('a fix', async () => {
        const pipe = start('/usr/bin/gpspipe', ['-w', '-n', '20', `127.0.0.1:${gps}`]);
        const line = await Promise.race([pipe.says(/.*"TPV".*"lat".*/), pause(20_000).then(() => null)]);
        await pipe.stop();
        return line && JSON.parse(line[0]);
      });
      assert.ok(in_the_bay({ latitude: fix.lat, longitude: fix.lon }), JSON.stringify(fix));
    });
  } else left_out.push('gpsd: it is not installed');

  const server = join(here, 'node_modules', 'signalk-server');
  if (existsSync(server) && Number(process.versions.node.split('.')[0]) >= 20) {
    const provider = (id, type, port) => ({
      id, enabled: true,
      pipeElements: [{ type: 'providers/simple', options: { logging: false, type, subOptions: { type: 'tcp', host: '127.0.0.1', port: String(port) } } }],
    });
    for (const [name, type, port, extra] of [
      ['Signal K deltas', 'SignalK', deltas, ['environment.wind.speedApparent', 'steering.rudderAngle', 'electrical.batteries.main.voltage', 'communication.links.xbee.up']],
      ['NMEA 0183', 'NMEA0183', nmea, ['navigation.headingTrue', 'environment.wind.speedApparent']],
    ]) {
      await check(`signalk-server, fed with ${name}, shows the boat`, async () => {
        const folder = join(work, type), http = await free_port();
        mkdirSync(folder);
        writeFileSync(join(folder, 'settings.json'), JSON.stringify({
          interfaces: {}, mdns: false, ssl: false, port: http, pipedProviders: [provider('boat', type, port)],
        }));
        writeFileSync(join(folder, 'baseDeltas.json'), JSON.stringify([{ context: 'vessels.self', updates: [{ values: [{ path: '', value: { name: 'Tirma' } }] }] }]));
        const running = start(process.execPath, [join(server, 'bin', 'signalk-server'), '-c', folder],
          { env: { ...process.env, PORT: String(http), SIGNALK_NODE_CONFIG_DIR: folder }, cwd: folder });
        const get = async path => {
          const answer = await fetch(`http://127.0.0.1:${http}/signalk/v1/api/vessels/self/${path.replaceAll('.', '/')}`);
          return answer.ok ? answer.json() : null;
        };
        try {
          const at = await until('a position', () => get('navigation.position'));
          assert.ok(in_the_bay(at.value), JSON.stringify(at));
          for (const path of extra) {
            const told = await until(path, () => get(path));
            assert.notEqual(told.value, undefined, path);
          }
        } catch (why) { throw new Error(`${why.message}\n${running.log()}`); }
        await running.stop();
      });
    }
  } else left_out.push(existsSync(server) ? `signalk-server: it takes node 20, and this is ${process.version}` : 'signalk-server: run `npm ci` in tests/signalk');
} finally {
  socket.close();
  for (const one of programs.reverse()) await one.stop();
  rmSync(work, { recursive: true, force: true });
}
for (const one of left_out) console.log(`left out  ${one}`);
console.log(`${passed} passed, ${failed} failed`);
process.exit(failed ? 1 : 0);
