// MQTT.js at the broker of a running system (stories.py starts all): what the bridge publishes, a call, a publication.
// usage: node check_mqtt.mjs URL
import mqtt from "mqtt";
import { randomUUID } from "node:crypto";

const [url] = process.argv.slice(2);
const limit = 30_000;

function expect(what, holds, found) {
  if (!holds) throw new Error(`${what}; found: ${JSON.stringify(found)}`);
}

function within(promise, what) {
  let timer;
  const late = new Promise((_, fail) => (timer = setTimeout(() => fail(new Error(`not in time: ${what}`)), limit)));
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}

const client = await within(mqtt.connectAsync(url, { protocolVersion: 5 }), "the connection");
const got = [];
let look = () => {};
client.on("message", (topic, payload, packet) => {
  got.push({ topic, payload: payload.toString(), retain: packet.retain, properties: packet.properties ?? {} });
  look();
});
function message(what, is) {
  return within(new Promise((done) => {
    look = () => { const found = got.find(is); if (found) done(found); };
    look();
  }), what);
}

try {
  await client.subscribeAsync(["ise/status", "ise/out/#", "answers/js"], { qos: 1 });
  const status = await message("the status", (one) => one.topic === "ise/status");
  expect("the bridge is online", status.payload === "online" && status.retain, status);

  const state = await message("the state", (one) => one.topic === "ise/out/crew/counter/state");
  expect("the latest packet is there", JSON.parse(state.payload).n === 2, state);
  expect("with its time and type", state.properties.contentType === "application/json" && !Number.isNaN(Date.parse(state.properties.userProperties.published)), state);

  const ask = (request) => ({ qos: 1, properties: { responseTopic: "answers/js", correlationData: Buffer.from(request) } });
  const one = randomUUID();
  await client.publishAsync("ise/call/crew/winch/pull", JSON.stringify({ number: 3 }), ask(one));
  await client.publishAsync("ise/call/crew/winch/pull", JSON.stringify({ number: 3 }), ask(one));
  const answer = await message("the answer", (it) => it.topic === "answers/js");
  expect("it is the answer to this request", answer.properties.correlationData.toString() === one, answer);
  expect("the call went well", answer.properties.userProperties.code === "ok" && JSON.parse(answer.payload).times === 1, answer);

  const wrong = randomUUID();
  await client.publishAsync("ise/call/crew/winch/pull", JSON.stringify({ number: -1 }), ask(wrong));
  const refusal = await message("the refusal", (it) => it.properties.correlationData?.toString() === wrong);
  const why = JSON.parse(refusal.payload);
  expect("an error has code, execution and text", why.code === "refused" && why.execution === "not_executed" && why.text.includes("forward only"), why);

  await client.publishAsync("ise/in/weather", JSON.stringify({ speed: 7.5 }), { qos: 1 });
} finally {
  await client.endAsync();
}
