// Numbers and times as people read them. Everything inside the page is SI and milliseconds of UTC.
import { embed, remember as put, wish } from './place.js';
import { has, languages, of_browser, speak, t } from './text.js';

const knots_per_mps = 3600 / 1852;
const choices = {
  units: ['kn', 'mps'], zone: ['utc', 'local'], theme: ['light', 'dark'], colour: ['speed', 'link'], tail: ['all', '24h', '6h', '1h', '15min'],
  pace: ['fit', '10', '60', '600', '3600'], lang: languages,
};
export const preferences = { units: 'kn', zone: 'utc', theme: 'auto', colour: 'speed', tail: 'all', pace: 'fit', left: 'speed', right: 'wind', lang: of_browser() };

const key = 'tracking-page';
try { Object.assign(preferences, JSON.parse(localStorage.getItem(key) ?? '{}')); } catch { /* private mode: defaults */ }
// What the address asks for goes before, and is not kept.
for (const [name, allowed] of Object.entries(choices)) preferences[name] = wish(name, ...allowed) ?? preferences[name];
export function allow(name, allowed) { // of choices that another module knows
  preferences[name] = wish(name, ...allowed) ?? preferences[name];
  if (!allowed.includes(preferences[name])) preferences[name] = allowed[0];
}
speak(preferences.lang);
export function remember(change) {
  Object.assign(preferences, change);
  if (change.lang) speak(change.lang);
  if (embed) return; // a frame on somebody else's page
  put(change);
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
  if (preferences.units === 'kn') return `${(metres / 1852).toFixed(metres < 18520 ? 2 : metres < 1852000 ? 1 : 0)} nm`;
  return `${(metres / 1000).toFixed(metres < 10000 ? 2 : metres < 1e6 ? 1 : 0)} km`;
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
export const zone_name = () => t(preferences.zone === 'utc' ? 'utc' : 'local_short');
export const clock = at => { const p = parts(at); return `${two(p.h)}:${two(p.mi)}:${two(p.s)}`; };
export const hour_minute = at => { const p = parts(at); return `${two(p.h)}:${two(p.mi)}`; };
export const minute_second = at => { const p = parts(at); return `${two(p.mi)}:${two(p.s)}`; };
export const day = at => { const p = parts(at); return `${p.d} ${t('months').split(' ')[p.mo]}`; };
/// How far a moment is after midnight, in the chosen zone.
export const of_day_ms = at => { const p = parts(at); return ((p.h * 60 + p.mi) * 60 + p.s) * 1000; };
/// The time, with the day where that is not today.
export function moment(at, now) {
  const same = day(at) === day(now) && Math.abs(now - at) < 86400000;
  return `${same ? '' : `${day(at)}, `}${clock(at)} ${zone_name()}`;
}

function angle(value, width, positive, negative) {
  const minutes = Math.round(Math.abs(value) * 60000) / 1000;
  const whole = Math.floor(minutes / 60);
  return `${String(whole).padStart(width, '0')}° ${(minutes - whole * 60).toFixed(3).padStart(6, '0')}′ ${value < 0 ? negative : positive}`;
}
export const latitude = deg => angle(deg, 2, t('north'), t('south'));
export const longitude = deg => angle(((deg + 540) % 360 + 360) % 360 - 180, 3, t('east'), t('west'));

export const link_name = source => has(`link_${source}`) ? t(`link_${source}`) : source || t('link_unknown');
export const mode_name = mode => !mode ? '–' : has(`mode_${mode}`) ? t(`mode_${mode}`) : mode;

const tails = { '24h': 86400000, '6h': 21600000, '1h': 3600000, '15min': 900000 };
/// How much of the track is shown, in milliseconds.
export const tail = () => tails[preferences.tail] ?? Infinity;

/// Great-circle distance in metres and initial bearing in degrees between two places of {latitude_deg, longitude_deg}.
export function between(a, b) {
  const r = Math.PI / 180, dlon = (b.longitude_deg - a.longitude_deg) * r, la = a.latitude_deg * r, lb = b.latitude_deg * r;
  const h = Math.sin((lb - la) / 2) ** 2 + Math.cos(la) * Math.cos(lb) * Math.sin(dlon / 2) ** 2;
  const to = Math.atan2(Math.sin(dlon) * Math.cos(lb), Math.cos(la) * Math.sin(lb) - Math.sin(la) * Math.cos(lb) * Math.cos(dlon));
  return { distance_m: 2 * 6371008.8 * Math.asin(Math.min(1, Math.sqrt(h))), bearing_deg: (to / r + 360) % 360 };
}
