// Takes the pictures of the page that the READMEs show, from page_preview's scripted boat: node take_pictures.mjs PAGE_PREVIEW FOLDER
// CHROMIUM names the browser (default /usr/bin/chromium).
import { spawn } from 'node:child_process';
import { mkdirSync, statSync } from 'node:fs';
import { once } from 'node:events';
import { createInterface } from 'node:readline';
import { chromium } from 'playwright-core';

const [program, folder] = process.argv.slice(2);
if (!folder) {
  console.error('usage: node take_pictures.mjs PAGE_PREVIEW FOLDER');
  process.exit(2);
}
mkdirSync(folder, { recursive: true });
const server = spawn(program, ['0'], { stdio: ['pipe', 'pipe', 'inherit'] });
const lines = createInterface({ input: server.stdout })[Symbol.asyncIterator]();
const url = (await lines.next()).value.split(' ').at(-1);
const tell = async line => { server.stdin.write(`${line}\n`); await lines.next(); };
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', args: ['--no-sandbox', '--disable-gpu'] });

async function take(name, options, { at = url, before = async () => {}, shown = '[data-boat=current]' } = {}) {
  const page = await browser.newPage({ timezoneId: 'Atlantic/Canary', reducedMotion: 'reduce', ...options });
  page.setDefaultTimeout(180000);
  await page.goto(at);
  await page.locator(`body${shown}`).waitFor();
  await page.locator('path.land').first().waitFor({ state: 'attached' });
  await before(page);
  await page.waitForTimeout(1500); // of beauty: the map has settled
  const path = `${folder}/${name}.jpg`;
  await page.screenshot({ path, type: 'jpeg', quality: 84 });
  await page.close();
  console.log(`${path}: ${Math.round(statSync(path).size / 1000)} kB`);
}

const desk = { viewport: { width: 1360, height: 850 } }, phone = { viewport: { width: 360, height: 760 }, deviceScaleFactor: 2, isMobile: true };
await take('page-day', { ...desk, colorScheme: 'light' });
await take('page-night-by-link', { ...desk, colorScheme: 'dark' }, { before: page => page.click('[data-colour=link]') });
await take('page-phone', { ...phone, colorScheme: 'light' });
await take('page-embedded', { viewport: { width: 480, height: 360 }, colorScheme: 'light' }, { at: `${url}embed` });
await tell('silence');
await tell('nodes off');
await take('page-no-current-data', { ...desk, colorScheme: 'light' }, { shown: '[data-boat=stale]' });

await browser.close();
const ended = once(server, 'exit');
server.stdin.end('quit\n');
await ended;
