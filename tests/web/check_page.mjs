// Loads the tracking page in headless Chromium against page_preview and checks what a person would see.
// node check_page.mjs PAGE_PREVIEW [FOLDER_FOR_SCREENSHOTS]
// CHROMIUM names the browser (default /usr/bin/chromium). Exits 0 only if every check held.
import { spawn } from 'node:child_process';
import { mkdirSync } from 'node:fs';
import { once } from 'node:events';
import { createInterface } from 'node:readline';
import assert from 'node:assert/strict';
import { chromium } from 'playwright-core';

const [program, folder] = process.argv.slice(2);
if (!program) {
  console.error('usage: node check_page.mjs PAGE_PREVIEW [FOLDER_FOR_SCREENSHOTS]');
  process.exit(2);
}
if (folder) mkdirSync(folder, { recursive: true });

async function serve(...more) {
  const server = spawn(program, ['0', ...more], { stdio: ['pipe', 'pipe', 'inherit'] });
  const lines = createInterface({ input: server.stdout })[Symbol.asyncIterator]();
  const url = (await lines.next()).value.split(' ').at(-1);
  const tell = async line => { server.stdin.write(`${line}\n`); assert.equal((await lines.next()).value, `ok ${line}`); };
  const stop = async () => { const ended = once(server, 'exit'); server.stdin.end('quit\n'); await ended; };
  return { url, tell, stop };
}
const { url, tell, stop } = await serve();

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'],
});
let failed = 0, checks = 0;
const check = async (name, body) => {
  try { await body(); console.log(`ok    ${name}`); ++checks; } catch (why) { ++failed; console.log(`FAIL  ${name}\n      ${String(why.message).split('\n').slice(0, 12).join('\n      ')}`); }
};
const complaints = [];
async function open(options, at = url) {
  const context = await browser.newContext(options);
  const page = await context.newPage();
  page.on('console', message => { if (message.type() === 'error' && !/ERR_|Failed to load resource/.test(message.text())) complaints.push(message.text()); });
  page.on('pageerror', error => complaints.push(String(error)));
  page.on('request', request => { if (!request.url().startsWith(at) && !request.url().startsWith('data:')) complaints.push(`asks another host: ${request.url()}`); });
  await page.goto(at);
  return page;
}
const text = (page, selector) => page.locator(selector).innerText();
// playwright's own waitForFunction evaluates a string, which the page's CSP forbids; so it is asked again and again.
// The bound only keeps a broken page from hanging the test.
async function until(what, happened) {
  for (const end = Date.now() + 60000; Date.now() < end;) {
    if (await happened()) return;
    await new Promise(resolve => setTimeout(resolve, 100));
  }
  throw new Error(`never happened: ${what}`);
}
const shown = (page, selector, pattern) => until(`${selector} shows ${pattern}`, async () => pattern.test(await page.locator(selector).innerText()));
const shot = async (page, name, full = false) => { if (folder) { await page.waitForTimeout(900); await page.screenshot({ path: `${folder}/${name}.png`, fullPage: full }); } };
const fits = page => page.evaluate(() => document.documentElement.scrollWidth <= document.documentElement.clientWidth);

const desktop = await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'light', timezoneId: 'Pacific/Kiritimati' });
await check('a live boat is shown with its values', async () => {
  await shown(desktop, '#pill', /^Live$/);
  await shown(desktop, '#age', /^\d s ago$/);
  await shown(desktop, '#sog', /^\d+\.\d$/);
  for (const id of ['#cog', '#heading']) assert.match(await text(desktop, id), /^\d{3}$/);
  assert.match(await text(desktop, '#coordinates'), /28° \d\d\.\d{3}′ N\s+015° \d\d\.\d{3}′ W/);
  assert.match(await text(desktop, '#source'), /XBee radio/);
  assert.match(await text(desktop, '#waypoint-name'), /\d of 3/);
  assert.match(await text(desktop, '#next-distance'), /\d+ m|nm/);
  assert.match(await text(desktop, '#twd'), /from \d{3}°/);
  assert.match(await text(desktop, '#awa'), /port|starboard/);
  assert.match(await text(desktop, '#mode'), /auto/);
  assert.match(await text(desktop, '#battery'), /83 % · 12\.7 V/);
  assert.match(await text(desktop, '#covered'), /nm/);
  assert.match(await text(desktop, '#elapsed'), /1 h/);
  assert.equal(await desktop.locator('#banner').isHidden(), true);
});
await check('boat, track, waypoints, coast, scale and attribution are on the map', async () => {
  await desktop.waitForSelector('.boat svg');
  await desktop.waitForSelector('path.land', { state: 'attached' });
  assert.equal(await desktop.locator('.waypoint').count(), 3);
  assert.equal(await desktop.locator('.waypoint.active').count(), 1);
  assert.ok((await desktop.locator('path.track').first().getAttribute('d')) !== null);
  assert.match(await text(desktop, '.leaflet-control-scale'), /m/);
  assert.match(await text(desktop, '.leaflet-control-attribution'), /GSHHG/);
  assert.ok(await desktop.locator('.degree').count() > 2);
});
await check('the position moves without reload', async () => {
  const before = await text(desktop, '#coordinates');
  await until('another position', async () => await text(desktop, '#coordinates') !== before);
});
await shot(desktop, 'desktop-live-light');
await check('units switch between knots and metres a second', async () => {
  const knots = Number(await text(desktop, '#average').then(t => t.split(' ')[0]));
  await desktop.click('[data-units=mps]');
  await shown(desktop, '#average', /m\/s/);
  const metres = Number(await text(desktop, '#average').then(t => t.split(' ')[0]));
  assert.ok(Math.abs(metres - knots * 0.5144) < 0.12, `${knots} kn, ${metres} m/s`);
  assert.match(await text(desktop, '#covered'), /km/);
  await desktop.click('[data-units=kn]');
});
await check('times switch between UTC and local', async () => {
  assert.match(await text(desktop, '#fix-time'), /UTC/);
  const utc = Number((await text(desktop, '#clock-time')).slice(0, 2));
  await desktop.click('[data-zone=local]');
  await shown(desktop, '#fix-time', /local/);
  const local = Number((await text(desktop, '#clock-time')).slice(0, 2));
  assert.equal((local - utc + 24) % 24, 14);
  await desktop.click('[data-zone=utc]');
});
await check('the slider shows the past and Live brings back the present', async () => {
  await desktop.locator('#slider').fill('300');
  await shown(desktop, '#fix-time', /shown from the track/);
  await desktop.waitForSelector('.boat.past');
  await shot(desktop, 'desktop-past-light');
  await desktop.click('#live');
  await shown(desktop, '#age', /ago/);
});
await check('the page is usable from the keyboard', async () => {
  await desktop.locator('#slider').focus();
  await desktop.keyboard.press('ArrowLeft');
  await shown(desktop, '#fix-time', /shown from the track/);
  await desktop.keyboard.press('End');
  await shown(desktop, '#age', /ago/);
  const unnamed = await desktop.evaluate(() => [...document.querySelectorAll('button, input, a')].filter(n =>
    !(n.innerText?.trim() || n.getAttribute('aria-label') || n.labels?.length)).map(n => n.outerHTML));
  assert.deepEqual(unnamed, []);
});
await check('GPX and KML are offered for download', async () => {
  for (const [path, mark] of [['track.gpx', '<trkpt'], ['track.kml', '<gx:coord>']]) {
    const answer = await desktop.request.get(url + path);
    assert.equal(answer.status(), 200);
    assert.match(answer.headers()['content-disposition'], /attachment/);
    assert.ok((await answer.text()).includes(mark));
  }
});
await check('nothing but this server is asked', async () => {
  const answer = await desktop.request.get(url);
  assert.match(answer.headers()['content-security-policy'], /default-src 'self'/);
});

const dark = await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
await shown(dark, '#pill', /^Live$/);
await shot(dark, 'desktop-live-dark');
const phone = await open({ viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, isMobile: true, hasTouch: true, colorScheme: 'light' });
await check('a phone shows everything without scrolling sideways', async () => {
  await shown(phone, '#age', /ago/);
  assert.ok(await fits(phone));
  for (const selector of ['#map', '#pill', '#age', '#dial', '#slider', '#speed-chart', '#next-distance']) {
    const box = await phone.locator(selector).boundingBox();
    assert.ok(box && box.width > 8 && box.x >= 0 && box.x + box.width <= 390.5, `${selector}: ${JSON.stringify(box)}`);
  }
});
await shot(phone, 'phone-live-light');
await shot(phone, 'phone-live-light-full', true);

await check('a boat that is silent is "no current data", with since when', async () => {
  await tell('silence');
  await shown(desktop, '#pill', /No current data/);
  await shown(desktop, '#banner', /No current data from the boat[^]*since \d\d:\d\d:\d\d UTC[^]*listening/);
  await desktop.waitForSelector('.boat.stale');
  assert.match(await text(desktop, '#next-eta'), /unknown/);
});
await check('a receiver that is off is named', async () => {
  await tell('receiver off');
  await shown(desktop, '#banner', /receiver of XBee radio is not connected since[^]*proxy does not answer/);
});
await shot(desktop, 'desktop-stale-light');
await shot(dark, 'desktop-stale-dark');
await shot(phone, 'phone-stale-light');
await check('a phone still fits when data is stale', async () => assert.ok(await fits(phone)));
await check('the boat comes back by itself', async () => {
  await tell('receiver on');
  await tell('resume');
  await shown(desktop, '#pill', /^Live$/);
  assert.equal(await desktop.locator('#banner').isHidden(), true);
});
await check('losing the server is told apart from losing the boat', async () => {
  await tell('close');
  await shown(desktop, '#pill', /Server lost/);
  await shown(desktop, '#banner', /This page lost the server[^]*since \d\d:\d\d:\d\d UTC/);
});
await shot(desktop, 'desktop-server-lost-light');
await shot(phone, 'phone-server-lost-light');
await check('a server that is back is found again, and the track has no hole', async () => {
  await tell('open');
  await shown(desktop, '#pill', /^Live$/);
  const { points } = await (await desktop.request.get(url + 'state.json')).json();
  assert.ok(points.length > 100);
});
await check('a rough fix shows its circle and says so', async () => {
  await tell('rough');
  await shown(desktop, '#accuracy', /within about/);
  await desktop.waitForSelector('path.accuracy', { state: 'attached' });
  await tell('rough');
});
const unheard = await serve('empty');
const early = await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'light' }, unheard.url);
await check('before the first position the page says that it waits, and starts by itself', async () => {
  await shown(early, '#pill', /Waiting for the boat/);
  await shown(early, '#banner', /No position yet/);
  assert.match(await text(early, '#fix-time'), /No position received yet/);
  await shot(early, 'desktop-waiting-light');
  await unheard.tell('resume');
  await shown(early, '#pill', /^Live$/);
});
await check('the pages raised no error and asked no other host', async () => assert.deepEqual(complaints, []));

await browser.close();
await stop();
await unheard.stop();
console.log(`${checks} checks held, ${failed} failed`);
process.exit(failed ? 1 : 0);
