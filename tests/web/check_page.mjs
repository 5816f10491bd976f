// Loads the tracking page in headless Chromium against page_preview and checks what a person would see.
// node check_page.mjs PAGE_PREVIEW [FOLDER_FOR_SCREENSHOTS]
// CHROMIUM names the browser (default /usr/bin/chromium). Exits 0 only if every check held.
import { spawn } from 'node:child_process';
import { mkdirSync, readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
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

// The whole of axe, in every page before its own scripts: the page's CSP lets none in later.
const axe = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

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
  await context.addInitScript({ content: axe });
  context.setDefaultTimeout(180000); // also on a machine that is busy; it only keeps a broken page from hanging the test
  const page = await context.newPage();
  page.on('console', message => { if (message.type() === 'error' && !/ERR_|Failed to load resource/.test(message.text())) complaints.push(message.text()); });
  page.on('pageerror', error => complaints.push(String(error)));
  page.on('request', request => { if (new URL(request.url()).origin !== new URL(at).origin && !request.url().startsWith('data:')) complaints.push(`asks another host: ${request.url()}`); });
  await page.goto(at);
  return page;
}
const text = (page, selector) => page.locator(selector).innerText();
// playwright's own waitForFunction evaluates a string, which the page's CSP forbids; so it is asked again and again.
// The bound only keeps a broken page from hanging the test.
async function until(what, happened) {
  for (const end = Date.now() + 180000; Date.now() < end;) {
    if (await happened()) return;
    await new Promise(resolve => setTimeout(resolve, 100));
  }
  throw new Error(`never happened: ${what}`);
}
const shown = (page, selector, pattern) => until(`${selector} shows ${pattern}`, async () => pattern.test(await page.locator(selector).innerText()));
const shot = async (page, name, full = false) => { if (folder) { await page.waitForTimeout(900); await page.screenshot({ path: `${folder}/${name}.png`, fullPage: full }); } };
async function accessible(page, what, frame = page) {
  await check(`axe finds nothing: ${what}`, async () => {
    const found = await frame.evaluate(async () => {
      const tags = ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'];
      const { violations, passes } = await axe.run(document, { runOnly: tags, resultTypes: ['violations', 'passes'] });
      const nodes = passes.reduce((sum, rule) => sum + rule.nodes.length, 0); // it did look, and at much
      if (passes.length < 10 || nodes < 15) return [`only ${passes.length} rules held, on ${nodes} elements`];
      return violations.map(v => `${v.id} (${v.impact}): ${v.help}: ${v.nodes.slice(0, 4).map(n => `${n.target} ${n.any[0]?.message ?? ''}`).join(' | ')}`);
    });
    assert.deepEqual(found, []);
  });
}
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
  assert.match(await text(desktop, '#mode'), /^Auto$/);
  assert.match(await text(desktop, '#head-mode'), /^Auto$/);
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
await check('the track is offered for download, and parsers of each format can read it', async () => {
  const files = await desktop.locator('[data-file]').evaluateAll(links => links.map(link => link.href));
  assert.deepEqual(files.map(f => f.split('.').at(-1)), ['gpx', 'kml', 'csv', 'geojson']);
  const [gpx, kml, csv, geojson] = await Promise.all(files.map(async file => {
    const answer = await desktop.request.get(file);
    assert.equal(answer.status(), 200);
    assert.match(answer.headers()['content-disposition'], /attachment; filename="a-tirma\./);
    return answer.text();
  }));
  const { points } = await (await desktop.request.get(url + 'state.json')).json();
  const fine = points.filter(p => !(p[9] > 200)).length, rough = points.length - fine;
  assert.ok(fine > 1000 && rough > 1);
  // The browser's own XML parser.
  const xml = (text, queries) => desktop.evaluate(([text, queries]) => {
    const read = new DOMParser().parseFromString(text, 'application/xml');
    const wrong = read.querySelector('parsererror');
    return wrong ? wrong.textContent : queries.map(([space, name]) => read.getElementsByTagNameNS(space, name).length);
  }, [text, queries]);
  const topografix = 'http://www.topografix.com/GPX/1/1', google = 'http://www.google.com/kml/ext/2.2', ogc = 'http://www.opengis.net/kml/2.2';
  const close = (a, b) => assert.ok(Math.abs(a - b) < 60, `${a} and ${b}`); // the boat sails on meanwhile
  const [gpxs, trk, trkpt, time, rtept] = await xml(gpx, ['gpx', 'trk', 'trkpt', 'time', 'rtept'].map(n => [topografix, n]));
  assert.deepEqual([gpxs, trk, rtept], [1, 1, 3]);
  close(trkpt, fine);
  assert.equal(time, trkpt);
  const [documents, when, coord] = await xml(kml, [[ogc, 'Document'], [ogc, 'when'], [google, 'coord']]);
  assert.equal(documents, 1);
  close(coord, fine);
  assert.equal(when, coord + 1 + rough); // of the last position and of rough fixes too
  const rows = csv.trimEnd().split('\r\n').map(row => row.split(','));
  assert.ok(rows.every(row => row.length === rows[0].length));
  close(rows.length - 1, points.length);
  assert.ok(rows.slice(1).every(row => !Number.isNaN(Date.parse(row[0])) && Math.abs(row[1] - 28.15) < 0.1));
  const features = JSON.parse(geojson).features;
  assert.equal(features[0].geometry.type, 'MultiLineString');
  close(features[0].geometry.coordinates.flat().length, fine);
  assert.equal(features.filter(f => f.properties.kind === 'rough fix').length, rough);
});
await check('the tail shortens track and charts, and its length is kept', async () => {
  const drawn = () => desktop.evaluate(() => [...document.querySelectorAll('path.track')].map(p => p.getAttribute('d')?.length ?? 0).reduce((a, b) => a + b));
  const whole = await drawn();
  await desktop.selectOption('#tail', '15min');
  await until('a shorter track', async () => await drawn() < whole / 2);
  await until('shorter charts', async () => { // "from 14:05 to 14:20"
    const [, h1, m1, h2, m2] = (await desktop.locator('#left-chart').getAttribute('aria-label')).match(/from (\d\d):(\d\d) to (\d\d):(\d\d)/).map(Number);
    return ((h2 * 60 + m2) - (h1 * 60 + m1) + 1440) % 1440 <= 16;
  });
  await shot(desktop, 'desktop-tail-light');
  await desktop.selectOption('#tail', 'all');
});
await check('the track is coloured by speed or by link, and rough fixes have their circle', async () => {
  await until('circles', async () => await desktop.locator('path.rough-area').count() > 1);
  await desktop.click('[data-colour=link]');
  await until('a line of each link', async () => (await desktop.locator('path.link-gprs:not(.recent)').getAttribute('d'))?.length > 10 && (await desktop.locator('path.link-xbee:not(.recent)').getAttribute('d')).length > 10);
  assert.match(await text(desktop, '#legend'), /XBee[^]*GPRS[^]*Iridium/);
  await shot(desktop, 'desktop-by-link-light');
  await desktop.click('[data-colour=speed]');
});
await check('the track can be played', async () => {
  await desktop.click('#play');
  await desktop.waitForSelector('.boat.past');
  await desktop.waitForSelector('path.ahead', { state: 'attached' });
  await desktop.click('#play');
  const then = await desktop.locator('#slider').inputValue();
  assert.ok(Number(then) < 1000);
  await desktop.click('#live');
  await shown(desktop, '#age', /ago/);
});
await check('each link tells when it was heard', async () => {
  const rows = await desktop.locator('#links li').evaluateAll(all => all.map(li => [li.dataset.key, li.dataset.state, li.innerText]));
  assert.deepEqual(rows.map(r => r[0]), ['xbee', 'gprs', 'iridium']);
  assert.match(rows[0][2], /XBee radio[^]*ago/);
  assert.equal(rows[0][1], 'good');
  assert.match(await text(desktop, '#shore'), /node-1, backed by node-2/);
});
await check('the other boat is on the map and in the list, and has a page of its own', async () => {
  assert.match(await text(desktop, '#boats'), /A-Tirma[^]*Vela/);
  assert.equal(await desktop.locator('#boats [aria-current]').innerText().then(t => t.split('\n')[0].slice(0, 7)), 'A-Tirma');
  await desktop.waitForSelector('.other-boat i');
  const [other] = [await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'light' })];
  await other.click('#boats a:has-text("Vela")');
  await until('the page of the other boat', async () => /vela$/.test(other.url()));
  await until('its name', async () => await text(other, '#boat-name') === 'Vela');
  assert.match(await other.locator('[data-file="track.gpx"]').getAttribute('href'), /^vela\/track\.gpx$/);
  assert.match(await (await other.request.get(`${url}vela/track.gpx`)).text(), /<name>Vela<\/name>/);
  await other.context().close();
});
await check('while the past is shown, each boat of the fleet is where it was then', async () => {
  const sizes = { viewport: { width: 1440, height: 900 }, colorScheme: 'light' };
  const ago = minutes => new Date(Date.now() - minutes * 60000).toISOString().slice(0, 19) + 'Z';
  const past = await open(sizes, `${url}#map=14/28.15300/-15.44000&t=${ago(30)}`);
  const place_of = async () => { const box = await past.locator('.other-boat i').boundingBox(); return box && [box.x, box.y]; };
  await past.waitForSelector('.other-boat i');
  const [x, y] = await place_of();
  await past.click('#live');
  await until('it is at its anchorage', async () => { const now = await place_of(); return now && now[0] < x - 50 && now[1] > y + 50; });
  await past.context().close();
  const before = await open(sizes, `${url}#map=14/28.15300/-15.44000&t=${ago(60)}`);
  await until('its track is there', async () => before.evaluate(() => performance.getEntriesByType('resource').some(one => /vela\/track\.json/.test(one.name) && one.responseEnd > 0)));
  await before.click('#play'); // is drawn again and again
  await before.click('#play');
  assert.equal(await before.locator('.other-boat').count(), 0);
  await shot(before, 'fleet-before');
  await before.context().close();
});
await check('pointing at the track, a waypoint or, by a click, any place tells what is known of it, at once', async () => {
  const box = await desktop.locator('#map').boundingBox();
  const on_track = await desktop.evaluate(() => { // some point in the middle of the longest line
    const path = [...document.querySelectorAll('path.track')].sort((a, b) => b.getAttribute('d').length - a.getAttribute('d').length)[0];
    const at = path.getPointAtLength(path.getTotalLength() / 2), screen = new DOMPoint(at.x, at.y).matrixTransform(path.getScreenCTM());
    return [screen.x, screen.y];
  });
  await desktop.mouse.move(box.x + 5, box.y + box.height / 2);
  await desktop.mouse.move(...on_track);
  await shown(desktop, '#ask .title', /\d\d:\d\d:\d\d UTC/);
  assert.match(await text(desktop, '#ask'), /Speed[^]*kn[^]*COG[^]*Wind[^]*from[^]*Link[^]*(XBee|GPRS)/);
  await shot(desktop, 'desktop-ask-track');
  const took = await desktop.evaluate(([x, y]) => { // from the event to the words
    const card = document.getElementById('ask'), target = document.elementFromPoint(x, y), all = [];
    for (let i = 0; i < 20; ++i) {
      target.dispatchEvent(new MouseEvent('mouseout', { bubbles: true, clientX: x, clientY: y }));
      card.hidden = true;
      const before = performance.now();
      target.dispatchEvent(new MouseEvent('mousemove', { bubbles: true, clientX: x + i % 3, clientY: y }));
      all.push(performance.now() - before);
      if (card.hidden) throw new Error('nothing is told');
    }
    return Math.max(...all);
  }, on_track);
  assert.ok(took < 100, `${took} ms`);
  const waypoint = await desktop.locator('.waypoint.active i').boundingBox();
  await desktop.mouse.move(waypoint.x + 5, waypoint.y + 5);
  await shown(desktop, '#ask .title', /of 3/);
  assert.match(await text(desktop, '#ask'), /From the boat[^]*°, /);
  await desktop.mouse.click(box.x + box.width - 160, box.y + 120);
  await shown(desktop, '#ask .title', /°.*N.*°.*W/);
  await desktop.keyboard.press('Escape');
  assert.equal(await desktop.locator('#ask').isHidden(), true);
});
await check('the charts show every quantity, say which, and name the zone of their times', async () => {
  for (const [name, words] of [['battery', /Battery charge: between 83 and 83 %/], ['heel', /Heel: between/], ['signal_xbee', /Signal aboard, XBee: between -71/], ['wind_direction', /True wind direction/]]) {
    await desktop.selectOption('#left-quantity', name);
    await until(name, async () => words.test(await desktop.locator('#left-chart').getAttribute('aria-label')));
  }
  assert.match(await desktop.locator('#left-chart').getAttribute('aria-label'), / UTC/);
  await desktop.selectOption('#left-quantity', 'heel');
  await shot(desktop, 'desktop-heel');
  await desktop.selectOption('#left-quantity', 'speed');
});
await check('a copied link shows the same place, time and colours', async () => {
  await desktop.locator('#slider').fill('500');
  await desktop.click('[data-colour=link]');
  await desktop.click('.leaflet-control-zoom-in');
  await desktop.waitForTimeout(600); // of the zoom
  await desktop.click('#share');
  const then = await text(desktop, '#slider-time');
  const link = desktop.url();
  assert.match(link, /#.*map=[\d.]+\/28\.\d+\/-15\.\d+.*/);
  const other = await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'light', timezoneId: 'Pacific/Kiritimati' }, link);
  await until('the same time', async () => await text(other, '#slider-time') === then);
  assert.equal(await other.locator('[data-colour=link]').getAttribute('aria-pressed'), 'true');
  assert.equal(await other.locator('.boat.past').count(), 1);
  await other.click('#share');
  const [a, b] = [link, other.url()].map(u => new URLSearchParams(new URL(u).hash.slice(1)));
  assert.deepEqual([a.get('t'), a.get('colour')], [b.get('t'), b.get('colour')]);
  const [[zoom, ...there], [same_zoom, ...here]] = [a, b].map(of => of.get('map').split('/').map(Number));
  assert.equal(zoom, same_zoom);
  there.forEach((value, i) => assert.ok(Math.abs(value - here[i]) < 4e-5, `${there} and ${here}`)); // a pixel
  await other.context().close();
  await desktop.click('[data-colour=speed]');
  await desktop.click('#live');
  await desktop.click('#fit');
});
await check('the average is one of the speeds that are shown, whatever the clock', async () => {
  const { points } = await (await desktop.request.get(url + 'state.json')).json();
  const mean = points.reduce((sum, p) => sum + p[3], 0) / points.length * 3600 / 1852;
  assert.ok(Math.abs(Number((await text(desktop, '#average')).split(' ')[0]) - mean) < 0.4, `${mean}`);
  assert.equal(await desktop.locator('#fast-clock').isHidden(), true);
});
await check('everything is there in Spanish, too, and the choice is in the address', async () => {
  await desktop.selectOption('#lang', 'es');
  await shown(desktop, '#pill', /^En directo$/);
  assert.equal(await desktop.locator('html').getAttribute('lang'), 'es');
  assert.match(await text(desktop, '#age'), /^hace \d/);
  assert.match(await text(desktop, '#head-mode'), /^Automático$/);
  await until('the address', async () => /lang=es/.test(desktop.url()));
  const english = await desktop.evaluate(() => document.body.innerText.match(/\b(ago|the|boat|since|Wind|Heading|Speed|whole|from)\b/g));
  assert.equal(english, null);
  await shot(desktop, 'desktop-spanish');
});
await accessible(desktop, 'live, in Spanish');
await desktop.selectOption('#lang', 'en');
await shown(desktop, '#pill', /^Live$/);
await accessible(desktop, 'live, light');
await desktop.locator('details summary').click();
await desktop.locator('#slider').fill('400');
await desktop.click('[data-colour=link]');
await accessible(desktop, 'past, by link, with the code for other pages');
await desktop.click('[data-colour=speed]');
await desktop.click('#live');
await check('a page of another site may show the small view in a frame, and not the whole page', async () => {
  const frames = createServer((request, reply) => reply.setHeader('content-type', 'text/html').end(`<!doctype html><html lang=en><title>x</title>
    <iframe name=small src="${url}embed?units=mps&theme=dark" width=480 height=360></iframe><iframe name=whole src="${url}" width=480 height=360></iframe>`)).listen(0, '127.0.0.1');
  await once(frames, 'listening');
  const context = await browser.newContext({ viewport: { width: 1000, height: 400 } });
  await context.addInitScript({ content: axe });
  context.setDefaultTimeout(180000);
  const page = await context.newPage();
  await page.goto(`http://127.0.0.1:${frames.address().port}/`);
  const small = page.frame('small');
  await until('the glance', async () => /\d s ago/.test(await small.locator('#glance').innerText()));
  assert.match(await small.locator('#glance').innerText(), /A-Tirma[^]*m\/s/);
  for (const hidden of ['.bar', '.panel', '.history']) assert.equal(await small.locator(hidden).isVisible(), false, hidden);
  assert.equal(await small.locator('.boat svg').isVisible(), true);
  assert.equal(await page.frame('whole').locator('#map').count(), 0); // refused by the browser
  if (folder) await page.screenshot({ path: `${folder}/embedded.png` });
  await accessible(page, 'the small view', small);
  await context.close();
  frames.close();
});
await check('axe would find what is wrong: a picture without words, a button without a name, faint letters', async () => {
  const bad = await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'light' });
  await shown(bad, '#pill', /^Live$/);
  const found = await bad.evaluate(async () => {
    const faint = document.createElement('p'), button = document.createElement('button'), picture = document.createElement('img');
    faint.textContent = 'hardly to be read';
    faint.style.color = '#ccc';
    faint.style.background = '#fff';
    picture.src = 'boat.svg';
    document.querySelector('main').prepend(faint, button, picture);
    const { violations } = await axe.run(document, { runOnly: ['wcag2a', 'wcag2aa'] });
    return violations.map(v => v.id);
  });
  for (const rule of ['button-name', 'color-contrast', 'image-alt']) assert.ok(found.includes(rule), `${rule}: ${found}`);
  await bad.context().close();
});
await check('what would ask another host is stopped by the page\'s policy, and would be seen here', async () => {
  const other = createServer((request, reply) => reply.end('')).listen(0, '127.0.0.1');
  await once(other, 'listening');
  const page = await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'light' });
  await shown(page, '#pill', /^Live$/);
  const before = complaints.length;
  let asked = 0;
  other.on('request', () => { ++asked; });
  const stopped = await page.evaluate(async port => {
    const told = [];
    document.addEventListener('securitypolicyviolation', event => told.push(event.effectiveDirective));
    await fetch(`http://127.0.0.1:${port}/`).catch(() => {});
    const script = document.createElement('script');
    script.textContent = 'window.ran = true';
    document.head.append(script);
    const away = document.createElement('script');
    away.src = `http://127.0.0.1:${port}/x.js`;
    document.head.append(away);
    await new Promise(resolve => { away.onerror = resolve; away.onload = resolve; });
    return { told, ran: window.ran === true };
  }, other.address().port);
  assert.equal(stopped.ran, false);
  assert.ok(stopped.told.includes('connect-src') && stopped.told.filter(d => d === 'script-src-elem').length === 2, `${stopped.told}`);
  assert.equal(asked, 0);
  await until('complaints of the browser', async () => complaints.length > before);
  complaints.length = before; // these were wanted
  await page.context().close();
  other.close();
});
await check('nothing but this server is asked', async () => {
  const answer = await desktop.request.get(url);
  assert.match(answer.headers()['content-security-policy'], /default-src 'self'/);
});

const dark = await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
await shown(dark, '#pill', /^Live$/);
await shot(dark, 'desktop-live-dark');
await accessible(dark, 'live, dark');
const phone = await open({ viewport: { width: 360, height: 780 }, deviceScaleFactor: 2, isMobile: true, hasTouch: true, colorScheme: 'light' });
await check('a phone shows everything without scrolling sideways', async () => {
  await shown(phone, '#age', /ago/);
  await phone.waitForSelector('#legend');
  assert.ok(await fits(phone));
  for (const selector of ['#map', '#pill', '#age', '#dial', '#slider', '#left-chart', '#next-distance', '#links', '#tail', '#legend', '.files']) {
    const box = await phone.locator(selector).boundingBox();
    assert.ok(box && box.width > 8 && box.x >= 0 && box.x + box.width <= 360.5, `${selector}: ${JSON.stringify(box)}`);
  }
  const legend = await phone.locator('#legend').boundingBox(), source = await phone.locator('.leaflet-control-attribution').boundingBox();
  assert.ok(legend.y + legend.height <= source.y + 1, 'the source of the coast lies over the legend');
  const scale = await phone.locator('.leaflet-control-scale').boundingBox();
  for (const name of await phone.locator('.waypoint span').all()) {
    const box = await name.boundingBox();
    const beside = box.x + box.width <= scale.x || scale.x + scale.width <= box.x || box.y + box.height <= scale.y || scale.y + scale.height <= box.y;
    assert.ok(beside, `the scale lies over ${await name.textContent()}`);
  }
});
await shot(phone, 'phone-live-light');
await shot(phone, 'phone-live-light-full', true);
await accessible(phone, 'on a phone');

const upright = await open({ viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, isMobile: true, hasTouch: true, colorScheme: 'light', locale: 'es-ES' });
await check('a phone speaks its owner\'s language, and a tap tells of a waypoint', async () => {
  await shown(upright, '#pill', /^En directo$/);
  assert.ok(await fits(upright));
  const at = await upright.locator('.waypoint.active i').boundingBox();
  await upright.touchscreen.tap(at.x + 5, at.y + 5);
  await shown(upright, '#ask .title', /de 3/);
  await shot(upright, 'phone-390-ask-spanish');
  await upright.click('#ask .close');
});
await shot(upright, 'phone-390-spanish');
await shot(upright, 'phone-390-spanish-full', true);
await accessible(upright, 'on a phone, in Spanish');
const sideways = await open({ viewport: { width: 844, height: 390 }, deviceScaleFactor: 2, isMobile: true, hasTouch: true, colorScheme: 'light' });
await check('a phone on its side shows map and values beside each other', async () => {
  await shown(sideways, '#age', /ago/);
  assert.ok(await fits(sideways));
  for (const selector of ['#map', '#pill', '#age', '#sog', '#slider', '#legend']) {
    const box = await sideways.locator(selector).boundingBox();
    assert.ok(box && box.x >= 0 && box.x + box.width <= 844.5 && box.y >= 0 && box.y + box.height <= 390.5, `${selector}: ${JSON.stringify(box)}`);
  }
  const map = await sideways.locator('#map').boundingBox();
  assert.ok(map.height > 200 && map.width > 400, JSON.stringify(map));
});
await shot(sideways, 'phone-sideways');
await accessible(sideways, 'on a phone on its side');
const wall = await open({ viewport: { width: 3840, height: 2160 }, colorScheme: 'dark' });
await check('a 4K screen has letters that are read from further away', async () => {
  await shown(wall, '#age', /ago/);
  assert.ok(await fits(wall));
  assert.ok(await wall.evaluate(() => parseFloat(getComputedStyle(document.getElementById('sog')).fontSize)) > 30);
});
await shot(wall, 'wall-4k');
await accessible(wall, 'on a 4K screen');
await wall.context().close();

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
  await desktop.waitForSelector('#links [data-key=xbee][data-state=off]');
});
await shot(desktop, 'desktop-stale-light');
await shot(dark, 'desktop-stale-dark');
await shot(phone, 'phone-stale-light');
await check('a phone still fits when data is stale', async () => assert.ok(await fits(phone)));
await accessible(desktop, 'no current data');
await accessible(upright, 'no current data, in Spanish');
await check('a shore that is lost is named, and no link is called well', async () => {
  await tell('nodes off');
  await shown(desktop, '#shore', /No connection to the shore station since/);
  await shown(desktop, '#banner', /No connection to the shore station since/);
  for (const state of await desktop.locator('#links li').evaluateAll(all => all.map(li => li.dataset.state))) assert.equal(state, 'unknown');
  await tell('nodes on');
  await shown(desktop, '#shore', /node-2/);
});
await check('where the gateway believes the boat to be is shown when nothing better is known, with its error', async () => {
  await tell('estimate');
  await shown(desktop, '#accuracy', /within about 900 m/);
  await shown(desktop, '#source', /Iridium/);
});
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
  await shown(desktop, '#shore', /not known: this page lost the server/);
  assert.equal(await desktop.locator('#links [data-state=good]').count(), 0);
});
await accessible(desktop, 'server lost');
await accessible(upright, 'server lost, in Spanish');
await shot(desktop, 'desktop-server-lost-light');
await shot(dark, 'desktop-server-lost-dark');
await shot(phone, 'phone-server-lost-light');
await check('a server that is back is found again, and the track has no hole', async () => {
  await tell('open');
  await shown(desktop, '#pill', /^Live$/);
  const { points } = await (await desktop.request.get(url + 'state.json')).json();
  assert.ok(points.length > 100);
});
await check('a device without a network says so, and goes on when it is back', async () => {
  await desktop.context().setOffline(true);
  await tell('close');
  await shown(desktop, '#banner', /This device is offline/);
  await desktop.context().setOffline(false);
  await tell('open');
  await shown(desktop, '#pill', /^Live$/);
});
await check('a wind that is not told any more shows its age, and no angle from a bow that has turned since', async () => {
  await shown(desktop, '#awa', /port|starboard/);
  await tell('wind off');
  await shown(desktop, '#awa', /^–$/);
  assert.match(await text(desktop, '#twd'), /from \d{3}°/);
  await desktop.waitForSelector('.arrow.apparent.absent', { state: 'attached' });
  await tell('wind on');
  await shown(desktop, '#awa', /port|starboard/);
});
await check('a rough fix shows its circle and says so', async () => {
  await tell('rough');
  await shown(desktop, '#accuracy', /within about/);
  await desktop.waitForSelector('path.accuracy', { state: 'attached' });
  await tell('rough');
});
const voyage = await serve('ocean');
const ocean = await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'light' }, voyage.url);
await check('a track from the Canaries to the Caribbean fits, with the coasts of both sides, and its outage is no line', async () => {
  await shown(ocean, '#age', /ago/);
  await until('the track', async () => (await ocean.locator('path.track').evaluateAll(all => all.map(p => p.getAttribute('d')).join('').length)) > 1000);
  await until('the coast', async () => await ocean.locator('path.land.world').count() > 5);
  assert.match(await text(ocean, '.leaflet-control-attribution'), /Natural Earth/);
  assert.match(await text(ocean, '#pill'), /Live/); // thirty seconds old, at ten minutes a report
  const ends = await ocean.locator('path.gap-end').evaluateAll(all => all.map(p => { const b = p.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }));
  assert.equal(ends.length, 2);
  const between = [(ends[0][0] + ends[1][0]) / 2, (ends[0][1] + ends[1][1]) / 2];
  assert.ok(Math.hypot(ends[0][0] - ends[1][0], ends[0][1] - ends[1][1]) > 20);
  const crossed = await ocean.evaluate(([x, y]) => [...document.querySelectorAll('path.track, path.ahead')].filter(path => {
    const at = new DOMPoint(x, y).matrixTransform(path.getScreenCTM().inverse()), box = 12;
    for (let l = 0, all = path.getTotalLength(); l < all; l += 4) { const p = path.getPointAtLength(l); if (Math.hypot(p.x - at.x, p.y - at.y) < box) return true; }
    return false;
  }).length, between);
  assert.equal(crossed, 0);
  await shot(ocean, 'ocean-light');
});
await check('the chart can be zoomed out to the whole world, and at home its detail has an edge', async () => {
  for (let i = 0; i < 12; ++i) await ocean.keyboard.press('Tab'); // somewhere in the page
  await ocean.locator('#map').focus();
  for (let i = 0; i < 5; ++i) { await ocean.keyboard.press('-'); await ocean.waitForTimeout(350); }
  await until('the whole world', async () => await ocean.locator('path.land.world').count() > 80);
  await shot(ocean, 'ocean-world');
  const home = await open({ viewport: { width: 1440, height: 900 }, colorScheme: 'light' }, `${voyage.url}#map=9/28.3/-14.6`);
  await until('its edge', async () => await home.locator('path.edge').count() === 1);
  await shown(home, '#coarse', /only within the frame/);
  await until('the other islands', async () => await home.locator('path.land.world').count() > 0);
  await shot(home, 'ocean-home');
  await accessible(home, 'the edge of the detailed coast');
  await home.context().close();
});
await accessible(ocean, 'the world');
await ocean.context().close();
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
await voyage.stop();
console.log(`${checks} checks held, ${failed} failed`);
process.exit(failed ? 1 : 0);
