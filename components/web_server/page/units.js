// Numbers and times as people read them. Everything inside the page is SI and milliseconds of UTC.
import { embed, wish } from './place.js';

const knots_per_mps = 3600 / 1852;
export const preferences = { units: 'kn', zone: 'utc', theme: 'auto', colour: 'speed', tail: 'all' };

const key = 'tracking-page';
try { Object.assign(preferences, JSON.parse(localStorage.getItem(key) ?? '{}')); } catch { /* private mode: defaults */ }
// What the address asks for goes before, and is not kept.
for (const [name, ...allowed] of [['units', 'kn', 'mps'], ['zone', 'utc', 'local'], ['theme', 'light', 'dark'], ['colour', 'speed', 'link'], ['tail', 'all', '24h', '6h', '1h', '15min']])
  preferences[name] = wish(name, ...allowed) ?? preferences[name];
export function remember(change) {
  Object.assign(preferences, change);
  if (embed) return; // a frame on somebody else's page
  try { localStorage.setItem(key, JSON.stringify(preferences)); } catch { /* not kept, still applied */ }
}

export const known = value => typeof value === 'number' && Number.isFinite(value);
export const speed_value = mps => preferences.units === 'kn' ? mps * knots_per_mps : mps;
export const speed_unit = () => preferences.units === 'kn' ? 'kn' : 'm/s';
export const speed = mps => known(mps) ? speed_value(mps).toFixed(1) : '–';
export const degrees = deg => known(deg) ? String(Math.round(((deg % 360) + 360) % 360) % 360).padStart(3, '0') : '–';

export function distance(metres) {
  if (!known(metres)) return '–';
  if (metres < 1000) return `${Math.round(metres)} m`;
  if (preferences.units === 'kn') return `${(metres / 1852).toFixed(metres < 18520 ? 2 : 1)} nm`;
  return `${(metres / 1000).toFixed(metres < 10000 ? 2 : 1)} km`;
}

export function duration(ms) {
  if (!known(ms)) return '–';
  const s = Math.max(0, Math.floor(ms / 1000));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${String(s % 60).padStart(2, '0')} s`;
  if (s < 86400) return `${Math.floor(s / 3600)} h ${String(Math.floor(s / 60) % 60).padStart(2, '0')} min`;
  return `${Math.floor(s / 86400)} d ${Math.floor(s / 3600) % 24} h`;
}

const two = n => String(n).padStart(2, '0');
const parts = at => {
  const d = new Date(at);
  return preferences.zone === 'utc'
    ? { y: d.getUTCFullYear(), mo: d.getUTCMonth(), d: d.getUTCDate(), h: d.getUTCHours(), mi: d.getUTCMinutes(), s: d.getUTCSeconds() }
    : { y: d.getFullYear(), mo: d.getMonth(), d: d.getDate(), h: d.getHours(), mi: d.getMinutes(), s: d.getSeconds() };
};
const months = ['Jan', 'Feb', 'Mar', 'Apr', 'May', 'Jun', 'Jul', 'Aug', 'Sep', 'Oct', 'Nov', 'Dec'];
export const zone_name = () => preferences.zone === 'utc' ? 'UTC' : 'local';
export const clock = at => { const p = parts(at); return `${two(p.h)}:${two(p.mi)}:${two(p.s)}`; };
export const hour_minute = at => { const p = parts(at); return `${two(p.h)}:${two(p.mi)}`; };
export const day = at => { const p = parts(at); return `${p.d} ${months[p.mo]}`; };
/// The time, with the day where that is not today.
export function moment(at, now) {
  const same = day(at) === day(now) && Math.abs(now - at) < 86400000;
  return `${same ? '' : day(at) + ', '}${clock(at)} ${zone_name()}`;
}

function angle(value, width, positive, negative) {
  const minutes = Math.round(Math.abs(value) * 60000) / 1000;
  const whole = Math.floor(minutes / 60);
  return `${String(whole).padStart(width, '0')}° ${(minutes - whole * 60).toFixed(3).padStart(6, '0')}′ ${value < 0 ? negative : positive}`;
}
export const latitude = deg => angle(deg, 2, 'N', 'S');
export const longitude = deg => angle(deg, 3, 'E', 'W');

const links = { xbee: 'XBee radio', gprs: 'GPRS', iridium: 'Iridium satellite', communication: 'Shore station' };
export const link_name = source => links[source] ?? (source || 'unknown link');

const tails = { '24h': 86400000, '6h': 21600000, '1h': 3600000, '15min': 900000 };
/// How much of the track is shown, in milliseconds.
export const tail = () => tails[preferences.tail] ?? Infinity;
