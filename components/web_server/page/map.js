// The map: sea, coast, graticule, scale; the boat, its track, its course.
import * as L from './leaflet.js';
import { is_rough } from './store.js';
import { known } from './units.js';

const buckets = 6;
const link_kinds = ['xbee', 'gprs', 'iridium', 'other'];
const most_circles = 24; // of rough fixes, the newest
const gap_ms = 600000;
const places = [ // name, latitude, longitude, least zoom, kind
  ['Gran Canaria', 27.958, -15.600, 8, 'land'], ['La Isleta', 28.171, -15.422, 12, 'land'],
  ['Las Palmas', 28.106, -15.433, 11, 'land'], ['Bahía del Confital', 28.143, -15.456, 13, 'sea'],
];
const hull = '<svg viewBox="-24 -24 48 48" aria-hidden="true"><path class="boat-hull" d="M0 -20C7 -10 8.5 2 6 16L-6 16C-8.5 2 -7 -10 0 -20Z"/><path class="boat-deck" d="M0 -12C3 -6 4 2 3 10L-3 10C-4 2 -3 -6 0 -12Z"/><line class="boat-boom" x1="0" y1="-5" x2="0" y2="13"/></svg>';

const degrees_minutes = (value, positive, negative) => {
  const tenths = Math.round(Math.abs(value) * 600);
  const whole = Math.floor(tenths / 600), minutes = (tenths - whole * 600) / 10;
  return `${whole}°${minutes ? `${(minutes % 1 ? minutes.toFixed(1) : minutes.toFixed(0)).padStart(minutes % 1 ? 4 : 2, '0')}′` : ''}${value < 0 ? negative : positive}`;
};

export class BoatMap {
  #map; #track = []; #by_link = []; #ahead; #rough = L.layerGroup(); #fleet = new Map(); #gaps; #boat; #element; #course; #waypoints = L.layerGroup(); #leg; #circle; #graticule = L.layerGroup();
  #placed = false; #attribution = '';
  follow = false;

  constructor(element, on_drag) {
    const calm = matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.#map = L.map(element, { zoomControl: false, attributionControl: true, zoomSnap: 0.25, minZoom: 7, maxZoom: 19, fadeAnimation: !calm, zoomAnimation: !calm });
    this.#map.attributionControl.setPrefix('Leaflet');
    L.control.zoom({ position: 'topright' }).addTo(this.#map);
    L.control.scale({ imperial: false, metric: true, position: 'bottomright' }).addTo(this.#map);
    this.#map.createPane('coast').style.zIndex = 300;
    this.#map.createPane('grid').style.zIndex = 350;
    this.#map.setView([27.98, -15.6], 9.5);
    this.#graticule.addTo(this.#map);
    this.#map.on('moveend', () => this.#draw_graticule());
    this.#map.on('dragstart', () => { this.follow = false; on_drag(); });
    new ResizeObserver(() => this.#map.invalidateSize({ animate: false })).observe(element);

    this.#gaps = L.polyline([], { className: 'track-gap', interactive: false }).addTo(this.#map);
    for (let i = 0; i < buckets; ++i)
      this.#track.push(L.polyline([], { className: `track speed-${i}`, interactive: false, smoothFactor: 0.7 }).addTo(this.#map));
    for (const kind of link_kinds)
      this.#by_link.push(L.polyline([], { className: `track by-link link-${kind}`, interactive: false, smoothFactor: 0.7 }).addTo(this.#map));
    this.#ahead = L.polyline([], { className: 'track ahead', interactive: false, smoothFactor: 0.7 }).addTo(this.#map);
    this.#rough.addTo(this.#map);
    this.#leg = L.polyline([], { className: 'leg', interactive: false }).addTo(this.#map);
    this.#course = L.polyline([], { className: 'course', interactive: false }).addTo(this.#map);
    this.#circle = L.circle([0, 0], { radius: 1, className: 'accuracy', interactive: false });
    this.#waypoints.addTo(this.#map);
    this.#boat = L.marker([0, 0], { icon: L.divIcon({ className: 'boat', html: hull, iconSize: [48, 48] }), interactive: false, keyboard: false, zIndexOffset: 1000 });
    this.#load_coast();
    this.#draw_graticule();
  }

  async #load_coast() {
    const coast = await (await fetch('coast.json')).json();
    this.#attribution = coast.attribution;
    this.#map.attributionControl.addAttribution(coast.attribution);
    // The lines along the shore of old charts: wide and faint first.
    for (const ring of [3, 2, 1, 0])
      L.geoJSON(coast, { pane: 'coast', interactive: false, style: () => ({ className: ring ? `shore shore-${ring}` : 'land' }) }).addTo(this.#map);
    for (const [name, lat, lon, zoom, kind] of places) {
      const label = L.marker([lat, lon], { pane: 'coast', interactive: false, keyboard: false, icon: L.divIcon({ className: `place ${kind}`, html: `<span>${name}</span>`, iconSize: [0, 0] }) });
      const check = () => { if (this.#map.getZoom() >= zoom) label.addTo(this.#map); else label.remove(); };
      this.#map.on('zoomend', check);
      check();
    }
  }

  #draw_graticule() {
    const bounds = this.#map.getBounds(), size = this.#map.getSize();
    this.#graticule.clearLayers();
    if (!size.x || !size.y) return;
    const per_pixel = (bounds.getEast() - bounds.getWest()) / size.x;
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120].map(m => m / 60).find(s => s / per_pixel > 105) ?? 5;
    const line = points => L.polyline(points, { pane: 'grid', className: 'graticule', interactive: false }).addTo(this.#graticule);
    const label = (at, text, kind) => L.marker(at, { pane: 'grid', interactive: false, keyboard: false, icon: L.divIcon({ className: `degree ${kind}`, html: `<span>${text}</span>`, iconSize: [0, 0] }) }).addTo(this.#graticule);
    const corner = this.#map.containerPointToLatLng([0, size.y]);
    const small = size.x < 600;
    for (let n = Math.ceil(bounds.getSouth() / step); n * step < bounds.getNorth(); ++n) {
      line([[n * step, bounds.getWest() - 1], [n * step, bounds.getEast() + 1]]);
      const y = this.#map.latLngToContainerPoint([n * step, 0]).y;
      if (y > 24 && y < size.y - (small ? 150 : 130)) label([n * step, corner.lng], degrees_minutes(n * step, 'N', 'S'), 'parallel');
    }
    for (let n = Math.ceil(bounds.getWest() / step); n * step < bounds.getEast(); ++n) {
      line([[bounds.getSouth() - 1, n * step], [bounds.getNorth() + 1, n * step]]);
      const x = this.#map.latLngToContainerPoint([0, n * step]).x;
      if (!small && x > 350 && x < size.x - 400) label([corner.lat, n * step], degrees_minutes(n * step, 'E', 'W'), 'meridian');
    }
  }

  /// The track between two times, in as many lines as there are colours: by speed, or by the link that brought each fix.
  /// What comes after `until` is only hinted at. Returns the speed of the last colour.
  show_track(track, { colour, from, until, sources }) {
    const speeds = track.map(p => p.speed_mps).filter(known).sort((a, b) => a - b);
    const top = Math.max(0.5, speeds[Math.floor(speeds.length * 0.98)] ?? 1);
    const by_link = colour === 'link', kinds = (sources ?? []).map(s => Math.max(0, link_kinds.indexOf(s) >= 0 ? link_kinds.indexOf(s) : 3));
    const lines = Array.from({ length: by_link ? link_kinds.length : buckets }, () => []), gaps = [], ahead = [], rough = [];
    let current = -1, line = null, previous = null;
    for (const point of track) {
      if (point.at < from) continue;
      const at = [point.latitude_deg, point.longitude_deg];
      if (is_rough(point)) { if (point.at <= until) rough.push(point); continue; }
      if (point.at > until) {
        if (!ahead.length && previous) ahead.push([previous.latitude_deg, previous.longitude_deg]);
        ahead.push(at);
        continue;
      }
      if (previous && point.at - previous.at > gap_ms) {
        gaps.push([[previous.latitude_deg, previous.longitude_deg], at]);
        line = null;
      }
      const bucket = by_link ? kinds[point.source] ?? 3 : known(point.speed_mps) ? Math.min(buckets - 1, Math.floor(point.speed_mps / top * buckets)) : 0;
      if (!line || bucket !== current) {
        const start = line && previous ? [[previous.latitude_deg, previous.longitude_deg], at] : [at];
        lines[current = bucket].push(line = start);
      } else line.push(at);
      previous = point;
    }
    this.#track.forEach((path, i) => path.setLatLngs(by_link ? [] : lines[i]));
    this.#by_link.forEach((path, i) => path.setLatLngs(by_link ? lines[i] : []));
    this.#gaps.setLatLngs(gaps);
    this.#ahead.setLatLngs(ahead);
    this.#rough.clearLayers();
    for (const point of rough.slice(-most_circles)) {
      const newest = point === rough.at(-1) ? ' newest' : '';
      const at = [point.latitude_deg, point.longitude_deg];
      L.circle(at, { radius: point.circular_error_m, className: `rough-area${newest}`, interactive: false }).addTo(this.#rough);
      L.circleMarker(at, { radius: 3, className: 'rough-fix', interactive: false }).addTo(this.#rough);
    }
    return top;
  }

  /// The other boats, each a link to its page.
  show_fleet(boats, own, now) {
    for (const boat of boats) {
      if (boat.id === own || !boat.position) continue;
      let marker = this.#fleet.get(boat.id);
      if (!marker) {
        const icon = L.divIcon({ className: 'other-boat', html: '<a tabindex="-1"><i></i><span></span></a>', iconSize: [0, 0] });
        marker = L.marker([0, 0], { icon, keyboard: false, interactive: true }).addTo(this.#map); // by keyboard: the list of boats
        const link = marker.getElement().querySelector('a');
        link.href = encodeURIComponent(boat.id);
        link.target = '_top'; // out of a frame
        link.querySelector('span').textContent = boat.name;
        this.#fleet.set(boat.id, marker);
      }
      marker.setLatLng([boat.position.latitude_deg, boat.position.longitude_deg]);
      marker.getElement().classList.toggle('old', now - boat.position.measured_at > boat.stale_after_s * 1000);
    }
  }

  show_waypoints(waypoints) {
    this.#waypoints.clearLayers();
    if (!waypoints?.points?.length) return;
    const at = p => [p.latitude_deg, p.longitude_deg];
    const route = waypoints.points.map(at);
    if (waypoints.closed && route.length > 2) route.push(route[0]);
    L.polyline(route, { className: 'route', interactive: false }).addTo(this.#waypoints);
    waypoints.points.forEach((p, i) => {
      const active = i === waypoints.active, name = p.name || `WP${i + 1}`;
      const icon = L.divIcon({ className: `waypoint${active ? ' active' : ''}`, html: '<i></i><span></span>', iconSize: [0, 0] });
      const marker = L.marker(at(p), { icon, interactive: false, keyboard: false }).addTo(this.#waypoints);
      marker.getElement().querySelector('span').textContent = name; // a name of the boat's: text, never markup
    });
  }

  /// The boat as it was then: `fix` needs a place; the rest draws what is known.
  show_boat({ fix, heading, course, speed, wind_from, target, past, stale }) {
    if (!fix) { this.#boat.remove(); this.#leg.setLatLngs([]); this.#course.setLatLngs([]); return; }
    const at = L.latLng(fix.latitude_deg, fix.longitude_deg);
    this.#boat.setLatLng(at).addTo(this.#map);
    const element = this.#boat.getElement(), picture = element.firstElementChild;
    element.classList.toggle('past', !!past);
    element.classList.toggle('stale', !!stale);
    const up = known(heading) ? heading : course;
    picture.style.transform = `rotate(${known(up) ? up : 0}deg)`;
    if (known(wind_from) && known(up)) { // the boom lies to leeward, further out the freer she sails
      const angle = ((wind_from - up) % 360 + 540) % 360 - 180;
      picture.querySelector('.boat-boom').setAttribute('transform', `rotate(${(Math.sign(angle) * Math.max(8, Math.abs(angle) * 0.45)).toFixed(0)} 0 -5)`);
    }
    this.#leg.setLatLngs(target && !past ? [at, [target.latitude_deg, target.longitude_deg]] : []);
    const ahead = [];
    if (!stale && known(course) && known(speed) && speed > 0.1) { // where she is in three minutes
      const metres = speed * 180, north = metres * Math.cos(course * Math.PI / 180) / 111195;
      ahead.push(at, [at.lat + north, at.lng + metres * Math.sin(course * Math.PI / 180) / 111195 / Math.cos(at.lat * Math.PI / 180)]);
    }
    this.#course.setLatLngs(ahead);
    if (known(fix.circular_error_m) && fix.circular_error_m > 30) this.#circle.setLatLng(at).setRadius(fix.circular_error_m).addTo(this.#map);
    else this.#circle.remove();
    if (this.follow && !past) this.#map.panTo(at, { animate: true, duration: 0.4 });
    else if (past && !this.#map.getBounds().pad(-0.05).contains(at)) this.#map.panTo(at);
  }

  /// Everything in view. The first time there is something to see this happens by itself.
  fit(track, waypoints, first_time = false) {
    if (first_time && this.#placed) return;
    const all = L.latLngBounds([...track.filter(p => !is_rough(p)).map(p => [p.latitude_deg, p.longitude_deg]), ...(waypoints?.points ?? []).map(p => [p.latitude_deg, p.longitude_deg])]);
    if (!all.isValid()) return;
    this.#placed = true;
    const small = this.#map.getSize().x < 600;
    this.#map.fitBounds(all, { paddingTopLeft: small ? [30, 40] : [110, 90], paddingBottomRight: small ? [84, 60] : [130, 90], maxZoom: 15.5, animate: !first_time });
  }

  centre(at) { this.#map.setView(at, Math.max(this.#map.getZoom(), 14.5)); }
}
