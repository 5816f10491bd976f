// How heavy the tracking page is: in headless Chromium over slow lines, with a track of 3000 points (page_preview ocean)
// and with a boat near its home coast: node weigh_page.mjs PAGE_PREVIEW [--check]
// Prints when the first telemetry stood there, bytes on the line, requests, and how busy the main thread is at a
// fourfold slower processor. With --check it fails where a figure is over its limit. CHROMIUM names the browser.
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { createInterface } from 'node:readline';
import { chromium } from 'playwright-core';

const [program, option] = process.argv.slice(2);
if (!program) {
  console.error('usage: node weigh_page.mjs PAGE_PREVIEW [--check]');
  process.exit(2);
}
const limits = { kilobytes: 150, requests: 8, busy_percent: 15 };
// Lines as Chromium's developer tools and WebPageTest define them: kbit/s down and up, and ms for a round trip.
const lines = {
  'fast 3G': { down: 1440, up: 675, round_trip: 562.5, limit_s: 2.5 },
  'slow 3G': { down: 400, up: 400, round_trip: 400, limit_s: 4 },
  'slow 3G of the developer tools': { down: 400, up: 400, round_trip: 2000 },
};
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', args: ['--no-sandbox', '--disable-gpu'] });
let over = 0;
const verdict = (value, limit) => { if (limit === undefined) return ''; if (value > limit) ++over; return value > limit ? `  OVER ${limit}` : `  (limit ${limit})`; };

for (const [scene, words] of [['ocean', '3000 points, Canaries to Caribbean'], ['', '1350 points off Gran Canaria, live']]) {
  const server = spawn(program, ['0', ...(scene ? [scene] : [])], { stdio: ['pipe', 'pipe', 'inherit'] });
  const said = createInterface({ input: server.stdout })[Symbol.asyncIterator]();
  const url = (await said.next()).value.split(' ').at(-1);
  console.log(words);
  for (const [line, { down, up, round_trip, limit_s }] of Object.entries(lines)) {
    const context = await browser.newContext({ viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, isMobile: true });
    const page = await context.newPage();
    page.setDefaultTimeout(180000);
    const cdp = await context.newCDPSession(page);
    await cdp.send('Network.enable');
    await cdp.send('Network.emulateNetworkConditions', { offline: false, latency: round_trip, downloadThroughput: down * 125, uploadThroughput: up * 125 });
    let bytes = 0;
    const asked = [];
    cdp.on('Network.requestWillBeSent', event => { if (event.request.url.startsWith('http')) asked.push(event.request.url.replace(url, '')); });
    cdp.on('Network.dataReceived', event => { bytes += event.encodedDataLength; });
    cdp.on('Network.responseReceived', event => { bytes += event.response.encodedDataLength; });
    await page.addInitScript(() => {
      const look = () => {
        if (/\d/.test(document.getElementById('sog')?.textContent ?? '') && window.first === undefined) window.first = performance.now();
        if ([...document.querySelectorAll('path.track')].some(path => (path.getAttribute('d') ?? '').length > 10) && window.track === undefined) window.track = performance.now();
        if (window.first === undefined || window.track === undefined) requestAnimationFrame(look);
      };
      requestAnimationFrame(look);
    });
    await page.goto(url);
    let times = [];
    for (const end = Date.now() + 120000; Date.now() < end && times[1] === undefined;) {
      times = await page.evaluate(() => [window.first, window.track]);
      await page.waitForTimeout(200);
    }
    await page.waitForTimeout(3000); // what comes after the track: the coast
    const first_s = times[0] / 1000, kilobytes = bytes / 1000;
    console.log(`  ${line}: ${down} kbit/s, ${round_trip} ms`);
    console.log(`    first telemetry ${first_s.toFixed(2)} s${verdict(first_s, limit_s)}, track ${(times[1] / 1000).toFixed(2)} s`);
    console.log(`    ${kilobytes.toFixed(0)} kB${verdict(kilobytes, limits.kilobytes)}, ${asked.length} requests${verdict(asked.length, limits.requests)}: ${asked.map(a => a.split('?')[0] || '/').join(' ')}`);
    await context.close();
  }
  if (!scene) {
    const context = await browser.newContext({ viewport: { width: 1440, height: 900 } });
    const page = await context.newPage();
    page.setDefaultTimeout(180000);
    const cdp = await context.newCDPSession(page);
    await page.goto(url);
    await page.locator('body[data-boat=current]').waitFor();
    await page.waitForTimeout(4000);
    await cdp.send('Performance.enable', { timeDomain: 'threadTicks' });
    await cdp.send('Emulation.setCPUThrottlingRate', { rate: 4 });
    const busy = async () => { const { metrics } = await cdp.send('Performance.getMetrics'); const of = name => metrics.find(m => m.name === name).value; return [of('TaskDuration'), of('Timestamp')]; };
    const before = await busy(), started = performance.now();
    await page.waitForTimeout(30000);
    const after = await busy(), percent = 100 * (after[0] - before[0]) / ((performance.now() - started) / 1000);
    console.log(`  main thread, processor four times slower: ${percent.toFixed(1)} %${verdict(percent, limits.busy_percent)}`);
    await context.close();
  }
  const ended = once(server, 'exit');
  server.stdin.end('quit\n');
  await ended;
}
await browser.close();
process.exit(option === '--check' && over ? 1 : 0);
