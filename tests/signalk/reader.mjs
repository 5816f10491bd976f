// A strict reader of Signal K delta streams and of NMEA 0183, written from the specifications alone.
import assert from 'node:assert/strict';
import { connect } from 'node:net';
import { createInterface } from 'node:readline';

const moment = /^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z$/;
const urn = /^urn:mrn:signalk:uuid:[0-9a-f]{8}-[0-9a-f]{4}-4[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}$/;
const path = /^[a-z][a-zA-Z0-9]*(\.[a-zA-Z0-9_]+)*$/;
const number = (low, high) => value => { assert.equal(typeof value, 'number'); assert.ok(value >= low && value <= high, `${value} is not in ${low} … ${high}`); };
const turn = number(0, 2 * Math.PI), half = number(-Math.PI, Math.PI), count = number(0, 1e12);
const keys = (value, names) => assert.deepEqual(Object.keys(value).sort(), [...names].sort());
const leaves = {
  '': value => { keys(value, ['name']); assert.equal(typeof value.name, 'string'); },
  'navigation.position': value => {
    if (value === null) return;
    keys(value, ['latitude', 'longitude']);
    number(-90, 90)(value.latitude);
    number(-180, 180)(value.longitude);
  },
  'navigation.speedOverGround': number(0, 30),
  'navigation.courseOverGroundTrue': turn,
  'navigation.headingTrue': turn,
  'navigation.gnss.satellites': number(0, 99),
  'navigation.attitude': value => { keys(value, ['roll', 'pitch', 'yaw']); Object.values(value).forEach(half); },
  'steering.rudderAngle': half,
  'environment.wind.angleApparent': half,
  'environment.wind.angleTrueWater': half,
  'environment.wind.directionTrue': turn,
  'environment.wind.speedApparent': number(0, 60),
  'environment.wind.speedTrue': number(0, 60),
  'electrical.batteries.main.voltage': number(0, 60),
  'electrical.batteries.main.current': number(-100, 100),
  'electrical.batteries.main.capacity.stateOfCharge': number(0, 1),
};
for (const link of ['xbee', 'gprs', 'iridium']) {
  const below = `communication.links.${link}.`;
  leaves[`${below}up`] = value => assert.equal(typeof value, 'boolean');
  leaves[`${below}rssi`] = number(-140, -1);
  for (const name of ['queued', 'sent', 'failed', 'dropped', 'lastHeardAge']) leaves[below + name] = count;
}

/** Throws unless it is a hello message; gives the vessel's identity. */
export function read_hello(line) {
  const hello = JSON.parse(line);
  keys(hello, ['name', 'version', 'timestamp', 'self', 'roles']);
  assert.match(hello.version, /^\d+\.\d+\.\d+$/);
  assert.match(hello.timestamp, moment);
  assert.ok(hello.self.startsWith('vessels.'));
  assert.match(hello.self.slice(8), urn);
  assert.ok(hello.roles.every(role => ['master', 'slave', 'main', 'aux'].includes(role)));
  return hello.self;
}

/** Throws unless it is a delta of paths and values that make sense; gives [path, value, source] of each. */
export function read_delta(line) {
  const delta = JSON.parse(line);
  keys(delta, ['context', 'updates']);
  assert.equal(delta.context, 'vessels.self');
  const told = [];
  for (const update of delta.updates) {
    keys(update, 'meta' in update ? ['$source', 'timestamp', 'values', 'meta'] : ['$source', 'timestamp', 'values']);
    assert.match(update.timestamp, moment);
    assert.match(update.$source, /^atirma\.(xbee|gprs|iridium|bridge)$/);
    for (const one of update.values) {
      keys(one, ['path', 'value']);
      if (one.path !== '') assert.match(one.path, path);
      assert.ok(leaves[one.path], `nobody knows the path ${one.path}`);
      leaves[one.path](one.value);
      told.push([one.path, one.value, update.$source]);
    }
    for (const one of update.meta ?? []) {
      keys(one, ['path', 'value']);
      assert.ok(leaves[one.path]);
      assert.equal(typeof one.value.description, 'string');
    }
  }
  return told;
}

/** Throws unless it is a sentence with a right checksum and a talker that we are; gives talker, kind and fields. */
export function read_sentence(line) {
  const parts = /^\$(GP|II)([A-Z]{3}),([\x20-\x7e]*)\*([0-9A-F]{2})\r$/.exec(line);
  assert.ok(parts, `no sentence: ${JSON.stringify(line)}`);
  assert.ok(line.length + 1 <= 82, 'longer than a sentence may be');
  const sum = [...line.slice(1, line.indexOf('*'))].reduce((all, c) => all ^ c.charCodeAt(0), 0);
  assert.equal(sum, Number.parseInt(parts[4], 16), `wrong checksum: ${line}`);
  const fields = { RMC: 12, GGA: 14, VTG: 9, HDT: 2, RSA: 4, MWV: 5 };
  const values = parts[3].split(',');
  assert.ok(parts[2] === 'XDR' ? values.length % 4 === 0 : values.length === fields[parts[2]], `wrong number of fields: ${line}`);
  return { talker: parts[1], kind: parts[2], fields: values };
}

/** The lines that a TCP server says, one after the other. */
export async function* lines_of(host, port) {
  const socket = connect(port, host);
  let rest = '';
  try {
    for await (const piece of socket) {
      rest += piece.toString('latin1');
      for (let end; (end = rest.indexOf('\n')) >= 0; rest = rest.slice(end + 1)) yield rest.slice(0, end);
    }
  } finally { socket.destroy(); }
}

/** A program whose output lines can be awaited; `stop` ends it and waits. */
export function run(spawn, command, args, options = {}) {
  const child = spawn(command, args, { stdio: ['ignore', 'pipe', 'pipe'], ...options });
  let log = '';
  child.stderr.on('data', piece => { log = (log + piece).slice(-8000); });
  const waiting = [];
  const seen = [];
  let ended = false;
  createInterface({ input: child.stdout }).on('line', line => {
    seen.push(line);
    if (seen.length > 500) seen.shift();
    for (const one of [...waiting]) one.look(line);
  });
  const exit = new Promise(resolve => child.on('exit', code => { ended = true; for (const one of [...waiting]) one.fail(code); resolve(code); }));
  return {
    log: () => log + seen.slice(-20).join('\n'),
    says: pattern => new Promise((resolve, reject) => {
      for (const line of seen) { const found = pattern.exec(line); if (found) return resolve(found); }
      if (ended) return reject(new Error(`${command} ended:\n${log}`));
      const one = {
        look: line => { const found = pattern.exec(line); if (found) { waiting.splice(waiting.indexOf(one), 1); resolve(found); } },
        fail: code => reject(new Error(`${command} ended with ${code}:\n${log}`)),
      };
      waiting.push(one);
    }),
    stop: async () => { if (!ended) child.kill('SIGTERM'); await exit; },
  };
}
