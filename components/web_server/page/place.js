// Where this page was opened: /, /BOAT, or /embed?boat=BOAT for a frame on somebody else's page.
const last = decodeURIComponent(location.pathname.split('/').at(-1));
const query = new URLSearchParams(location.search);
export const embed = last === 'embed';
/// The boat's address; empty: the first one.
export const boat = embed ? query.get('boat') ?? '' : last === 'index.html' ? '' : last;
/// Of the boat's data: url('events'), url('track.gpx').
export const url = (name, of = boat) => of ? `${encodeURIComponent(of)}/${name}` : name;
/// What the address asks for, such as ?units=mps&zone=local&theme=dark&tail=6h.
export const wish = (name, ...allowed) => allowed.includes(query.get(name)) ? query.get(name) : undefined;
