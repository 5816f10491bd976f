// Where this page was opened: /, /BOAT, or /embed?boat=BOAT for a frame on somebody else's page; and which view of it
// the address asks for, behind its '#' or its '?': map, t, colour, tail, units, zone, theme, lang, left, right.
const last = decodeURIComponent(location.pathname.split('/').at(-1));
const query = new URLSearchParams(location.search), hash = new URLSearchParams(location.hash.slice(1));
export const embed = last === 'embed';
/// The boat's address; empty: the first one.
export const boat = embed ? query.get('boat') ?? '' : last === 'index.html' ? '' : last;
/// Of the boat's data: url('events'), url('track.gpx').
export const url = (name, of = boat) => of ? `${encodeURIComponent(of)}/${name}` : name;
const asked = name => hash.get(name) ?? query.get(name);
/// What the address asks for, such as #units=mps&zone=local&theme=dark&tail=6h.
export const wish = (name, ...allowed) => allowed.includes(asked(name)) ? asked(name) : undefined;

/// [zoom, latitude, longitude], or null.
export const view = (() => {
  const numbers = (asked('map') ?? '').split('/').map(Number);
  const fits = numbers.length === 3 && numbers.every(Number.isFinite) && Math.abs(numbers[1]) <= 90 && Math.abs(numbers[2]) <= 540;
  return fits ? numbers : null;
})();
/// Milliseconds of UTC, or null for the present.
export const time = (() => { const at = Date.parse(asked('t') ?? ''); return Number.isFinite(at) ? at : null; })();

let writing = 0;
/// Puts a part of the view into the address, without a new page; null takes it out.
export function remember(change) {
  for (const [name, value] of Object.entries(change)) if (value === null) hash.delete(name); else hash.set(name, value);
  if (embed) return;
  clearTimeout(writing); // browsers allow few changes a second
  writing = setTimeout(() => history.replaceState(null, '', address()), 250);
}
/// The address of this view.
export function address() {
  const text = hash.toString().replaceAll('%2F', '/').replaceAll('%3A', ':');
  return `${location.pathname}${location.search}${text ? `#${text}` : ''}`;
}
export const map_text = (zoom, at) => `${+zoom.toFixed(2)}/${at.lat.toFixed(5)}/${at.lng.toFixed(5)}`;
// Somebody changed it by hand, or followed a link to another view.
addEventListener('hashchange', () => location.reload());
