// The map: sea, coast, graticule, scale; the boat, its track, its course; what lies under the pointer.
import * as L from 'leaflet/leaflet.esm.min.js';
import { is_rough } from './store.js';
import { t } from './text.js';
import { known } from './units.js';
import { Coast } from './world.js';

const buckets = 6;
const link_kinds = ['xbee', 'gprs', 'iridium', 'other'];
const most_circles = 24; // of rough fixes, the newest
const reach_px = 22;     // how far from the pointer a point of the track or a waypoint may lie
const hull = '<svg viewBox="-24 -24 48 48" aria-hidden="true"><path class="boat-hull" d="M0 -20C7 -10 8.5 2 6 16L-6 16C-8.5 2 -7 -10 0 -20Z"/><path class="boat-deck" d="M0 -12C3 -6 4 2 3 10L-3 10C-4 2 -3 -6 0 -12Z"/><line class="boat-boom" x1="0" y1="-5" x2="0" y2="13"/></svg>';

const degrees_minutes = (value, positive, negative) => {
  const tenths = Math.round(Math.abs(value) * 600);
  const whole = Math.floor(tenths / 600), minutes = (tenths - whole * 600) / 10;
  return `${whole}°${minutes ? `${(minutes % 1 ? minutes.toFixed(1) : minutes.toFixed(0)).padStart(minutes % 1 ? 4 : 2, '0')}′` : ''}${value < 0 ? negative : positive}`;
};
const place = p => [p.latitude_deg, p.longitude_deg];

export class BoatMap {
  #map; #track = []; #by_link = []; #recent; #ahead; #rough = L.layerGroup(); #fleet = new Map(); #ends = L.layerGroup(); #boat; #course; #waypoints = L.layerGroup(); #leg; #circle; #spot; #time; #graticule = L.layerGroup();
  #placed = false; #moving = 0; #coast; #tiles = null; #drawn = null; #pixels = null; #points = [];
  follow = false;

  /// `on_move(by_user)`, `on_point({kind, latlng, …} or null, chosen)`, `on_coarse(key or null)`.
  constructor(element, { view, on_move, on_drag, on_point, on_coarse }) {
    const calm = matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.#map = L.map(element, { zoomControl: false, attributionControl: true, zoomSnap: 0.25, minZoom: 1, maxZoom: 19, worldCopyJump: true, fadeAnimation: !calm, zoomAnimation: !calm, maxBounds: [[-85, -1e4], [85, 1e4]] });
    this.#map.attributionControl.setPrefix('Leaflet');
    L.control.zoom({ position: 'topright' }).addTo(this.#map);
    L.control.scale({ imperial: false, metric: true, position: 'bottomright' }).addTo(this.#map);
    this.#coast = new Coast(this.#map, on_coarse);
    this.#map.createPane('grid').style.zIndex = 350;
    this.#graticule.addTo(this.#map);
    this.#map.on('moveend', () => this.#draw_graticule());
    this.#map.on('dragstart', () => { this.follow = false; on_drag(); });
    this.#map.on('moveend', () => { if (this.#placed) on_move(!this.#moving); });
    new ResizeObserver(() => this.#quietly(() => this.#map.invalidateSize({ animate: false }))).observe(element);

    for (let i = 0; i < buckets; ++i)
      this.#track.push(L.polyline([], { className: `track speed-${i}`, interactive: false, smoothFactor: 0.7 }).addTo(this.#map));
    for (const kind of link_kinds)
      this.#by_link.push(L.polyline([], { className: `track by-link link-${kind}`, interactive: false, smoothFactor: 0.7 }).addTo(this.#map));
    this.#recent = L.polyline([], { className: 'track recent', interactive: false }).addTo(this.#map);
    this.#ahead = L.polyline([], { className: 'track ahead', interactive: false, smoothFactor: 0.7 }).addTo(this.#map);
    this.#ends.addTo(this.#map);
    this.#rough.addTo(this.#map);
    this.#leg = L.polyline([], { className: 'leg', interactive: false }).addTo(this.#map);
    this.#course = L.polyline([], { className: 'course', interactive: false }).addTo(this.#map);
    this.#circle = L.circle([0, 0], { radius: 1, className: 'accuracy', interactive: false });
    this.#spot = L.circleMarker([0, 0], { radius: 7, className: 'spot', interactive: false });
    this.#waypoints.addTo(this.#map);
    this.#boat = L.marker([0, 0], { icon: L.divIcon({ className: 'boat', html: hull, iconSize: [48, 48] }), interactive: false, keyboard: false, zIndexOffset: 1000 });
    this.#map.on('mousemove', event => on_point(this.#under(event.containerPoint, event.latlng, false), false));
    this.#map.on('mouseout', () => on_point(null, false));
    this.#map.on('click', event => on_point(this.#under(event.containerPoint, event.latlng, true), true));
    element.addEventListener('keydown', event => {
      if (event.key === 'Enter' && event.target === element) on_point(this.#under(this.#map.getSize().divideBy(2), this.#map.getCenter(), true), true);
    });
    if (view) this.#map.setView([view[1], view[2]], view[0]);
    this.#placed = !!view;
  }

  #quietly(move) { // not by the user
    ++this.#moving;
    move();
    setTimeout(() => --this.#moving, 600);
  }

  settle() { this.#coast.settle(); }
  where() { return [this.#map.getZoom(), this.#map.getCenter()]; }

  show_tiles(tiles) {
    if (!tiles || this.#tiles) return;
    this.#tiles = L.tileLayer(tiles.url, { attribution: tiles.attribution.replace(/[<>&]/g, ''), maxZoom: 19 }).addTo(this.#map);
    this.#map.getContainer().classList.add('tiled'); // the coast is theirs
  }

  rename() { this.#coast.rename(); if (this.#placed) this.#draw_graticule(); }

  #draw_graticule() {
    const bounds = this.#map.getBounds(), size = this.#map.getSize();
    this.#graticule.clearLayers();
    if (!size.x || !size.y) return;
    const per_pixel = (bounds.getEast() - bounds.getWest()) / size.x;
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 900, 1800, 3600].map(m => m / 60).find(s => s / per_pixel > 105) ?? 60;
    const line = points => L.polyline(points, { pane: 'grid', className: 'graticule', interactive: false }).addTo(this.#graticule);
    const label = (at, text, kind) => L.marker(at, { pane: 'grid', interactive: false, keyboard: false, icon: L.divIcon({ className: `degree ${kind}`, html: `<span>${text}</span>`, iconSize: [0, 0] }) }).addTo(this.#graticule);
    const corner = this.#map.containerPointToLatLng([0, size.y]);
    const small = size.x < 600, south = Math.max(-84, bounds.getSouth() - 1), north = Math.min(84, bounds.getNorth() + 1);
    for (let n = Math.ceil(south / step); n * step < north; ++n) {
      line([[n * step, bounds.getWest() - 1], [n * step, bounds.getEast() + 1]]);
      const y = this.#map.latLngToContainerPoint([n * step, 0]).y;
      if (y > 24 && y < size.y - (small ? 150 : 130)) label([n * step, corner.lng], degrees_minutes(n * step, t('north'), t('south')), 'parallel');
    }
    for (let n = Math.ceil(bounds.getWest() / step); n * step < bounds.getEast(); ++n) {
      line([[south, n * step], [north, n * step]]);
      const x = this.#map.latLngToContainerPoint([0, n * step]).x, shown = ((n * step + 540) % 360 + 360) % 360 - 180;
      if (!small && x > 420 && x < size.x - 400) label([corner.lat, n * step], degrees_minutes(shown, t('east'), t('west')), 'meridian');
    }
  }

  /// The track between two times, in as many lines as there are colours: by speed, or by the link that brought each fix.
  /// What comes after `until` is only hinted at; where the boat was not heard there is no line. Returns the speed of the
  /// last colour. While only newer points come, they are one line more until the whole is due again.
  show_track(store, { colour, from, until, force }) {
    const track = store.track, last = track.at(-1);
    const growing = this.#drawn && !force && until === Infinity && this.#drawn.epoch === store.epoch && this.#drawn.count <= track.length &&
      track[this.#drawn.count - 1] === this.#drawn.last && performance.now() - this.#drawn.at < 20000;
    if (growing) {
      this.#points.push(...track.slice(this.#drawn.seen).filter(p => !is_rough(p)));
      this.#drawn.seen = track.length;
      const recent = [];
      let line = null, previous = null;
      for (const point of track.slice(this.#drawn.count - 1)) {
        if (is_rough(point)) continue;
        if (!line || store.is_gap(previous, point)) recent.push(line = []);
        line.push(place(point));
        previous = point;
      }
      this.#recent.setLatLngs(recent);
      return this.#drawn.top;
    }
    const speeds = track.map(p => p.speed_mps).filter(known).sort((a, b) => a - b);
    const top = Math.max(0.5, speeds[Math.floor(speeds.length * 0.98)] ?? 1);
    const by_link = colour === 'link', kinds = (store.state.sources ?? []).map(s => link_kinds.indexOf(s) >= 0 ? link_kinds.indexOf(s) : 3);
    const lines = Array.from({ length: by_link ? link_kinds.length : buckets }, () => []), ends = [], ahead = [], rough = [];
    let current = -1, line = null, previous = null, newest = 0;
    this.#points = [];
    for (const point of track) {
      if (point.at < from) continue;
      const at = place(point);
      if (is_rough(point)) { if (point.at <= until) rough.push(point); continue; }
      const gap = previous && store.is_gap(previous, point);
      if (point.at > until) {
        if (!ahead.length || gap) ahead.push(previous && !gap ? [place(previous)] : []);
        ahead.at(-1).push(at);
        previous = point;
        continue;
      }
      if (gap) {
        ends.push(place(previous), at);
        line = null;
      }
      this.#points.push(point);
      const bucket = by_link ? kinds[point.source] ?? 3 : known(point.speed_mps) ? Math.min(buckets - 1, Math.floor(point.speed_mps / top * buckets)) : 0;
      if (!line || bucket !== current) {
        const start = line && previous ? [place(previous), at] : [at];
        lines[current = bucket].push(line = start);
      } else line.push(at);
      newest = bucket;
      previous = point;
    }
    this.#track.forEach((path, i) => path.setLatLngs(by_link ? [] : lines[i]));
    this.#by_link.forEach((path, i) => path.setLatLngs(by_link ? lines[i] : []));
    this.#recent.setLatLngs([]);
    this.#recent.getElement()?.setAttribute('class', ['track', 'recent', ...(by_link ? ['by-link', `link-${link_kinds[newest]}`] : [`speed-${newest}`])].join(' '));
    this.#ahead.setLatLngs(ahead);
    this.#ends.clearLayers();
    for (const at of ends.slice(-60)) L.circleMarker(at, { radius: 3.5, className: 'gap-end', interactive: false }).addTo(this.#ends);
    this.#rough.clearLayers();
    for (const point of rough.slice(-most_circles)) {
      const newest_fix = point === rough.at(-1) ? ' newest' : '';
      L.circle(place(point), { radius: point.circular_error_m, className: `rough-area${newest_fix}`, interactive: false }).addTo(this.#rough);
      L.circleMarker(place(point), { radius: 3, className: 'rough-fix', interactive: false }).addTo(this.#rough);
    }
    this.#drawn = until === Infinity && last ? { epoch: store.epoch, count: track.length, seen: track.length, last, top, at: performance.now() } : null;
    return top;
  }

  /// What lies there: the nearest waypoint or point of the track within reach, else, if `anywhere`, the place itself.
  #under(at, latlng, anywhere) {
    const zoom = this.#map.getZoom(), pixel = p => this.#map.project(place(p), zoom);
    const origin = this.#map.project(this.#map.containerPointToLatLng(at), zoom);
    const far = p => (p.x - origin.x) ** 2 + (p.y - origin.y) ** 2;
    let best = null, least = reach_px ** 2;
    (this.marks ?? []).forEach((mark, index) => { const d = far(pixel(mark)); if (d < least) { least = d; best = { kind: 'waypoint', index }; } });
    if (best) return { ...best, latlng, at };
    if (this.#pixels?.zoom !== zoom || this.#pixels.points !== this.#points || this.#pixels.all.length !== this.#points.length)
      this.#pixels = { zoom, points: this.#points, all: this.#points.map(pixel) };
    this.#pixels.all.forEach((p, i) => { const d = far(p); if (d < least) { least = d; best = { kind: 'point', point: this.#points[i] }; } });
    if (best) return { ...best, latlng, at };
    return anywhere ? { kind: 'place', latlng, at } : null;
  }

  /// A ring around what is asked about; null: none.
  mark(where) { if (where) this.#spot.setLatLng(place(where)).addTo(this.#map); else this.#spot.remove(); }

  /// The other boats, each a link to its page.
  show_fleet(boats, own, now) {
    for (const boat of boats) {
      if (boat.id === own) continue;
      let marker = this.#fleet.get(boat.id);
      if (!boat.position) { marker?.remove(); this.#fleet.delete(boat.id); continue; }
      if (!marker) {
        const icon = L.divIcon({ className: 'other-boat', html: '<a tabindex="-1"><i></i><span></span></a>', iconSize: [0, 0] });
        marker = L.marker([0, 0], { icon, keyboard: false, interactive: true }).addTo(this.#map); // by keyboard: the list of boats
        const link = marker.getElement().querySelector('a');
        link.href = encodeURIComponent(boat.id);
        link.target = '_top'; // out of a frame
        link.querySelector('span').textContent = boat.name;
        this.#fleet.set(boat.id, marker);
      }
      marker.setLatLng(place(boat.position));
      marker.getElement().classList.toggle('old', now - boat.position.measured_at >= boat.stale_after_s * 1000);
    }
  }

  show_waypoints(waypoints) {
    this.#waypoints.clearLayers();
    this.marks = waypoints?.points ?? [];
    if (!this.marks.length) return;
    const route = waypoints.points.map(place);
    if (waypoints.closed && route.length > 2) route.push(route[0]);
    L.polyline(route, { className: 'route', interactive: false }).addTo(this.#waypoints);
    waypoints.points.forEach((p, i) => {
      const active = i === waypoints.active, name = p.name || t('waypoint_number', { number: i + 1 });
      const icon = L.divIcon({ className: `waypoint${active ? ' active' : ''}`, html: '<i></i><span></span>', iconSize: [0, 0] });
      const marker = L.marker(place(p), { icon, interactive: false, keyboard: false }).addTo(this.#waypoints);
      marker.getElement().querySelector('span').textContent = name; // a name of the boat's: text, never markup
    });
  }

  /// The boat as it was then: `fix` needs a place; the rest draws what is known.
  show_boat({ fix, heading, course, speed, wind_from, target, past, time, stale }) {
    if (!this.#placed) return; // nothing is in view yet
    if (!fix) { this.#boat.remove(); this.#leg.setLatLngs([]); this.#course.setLatLngs([]); return; }
    const at = L.latLng(fix.latitude_deg, fix.longitude_deg);
    // Somebody who goes to another time goes on seeing the boat; a view that a link or a hand chose stays.
    const other_time = this.#time !== undefined && this.#time !== time;
    this.#time = time;
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
    this.#leg.setLatLngs(target && !past ? [at, place(target)] : []);
    const ahead = [];
    if (!stale && known(course) && known(speed) && speed > 0.1) { // where she is in three minutes
      const metres = speed * 180, north = metres * Math.cos(course * Math.PI / 180) / 111195;
      ahead.push(at, [at.lat + north, at.lng + metres * Math.sin(course * Math.PI / 180) / 111195 / Math.cos(at.lat * Math.PI / 180)]);
    }
    this.#course.setLatLngs(ahead);
    if (known(fix.circular_error_m) && fix.circular_error_m > 30) this.#circle.setLatLng(at).setRadius(fix.circular_error_m).addTo(this.#map);
    else this.#circle.remove();
    if (this.follow && !past) this.#quietly(() => this.#map.panTo(at, { animate: true, duration: 0.4 }));
    else if (past && other_time && !this.#map.getBounds().pad(-0.05).contains(at)) this.#quietly(() => this.#map.panTo(at));
  }

  /// Everything in view. The first time there is something to see this happens by itself: of a position alone with its
  /// surroundings, and once more when the track is here.
  fit(track, waypoints, fix, first_time = false) {
    if (first_time && this.#placed) return;
    const all = L.latLngBounds([...track.filter(p => !is_rough(p)), ...(waypoints?.points ?? []), ...(fix ? [fix] : [])].map(place));
    if (!all.isValid()) return;
    this.#placed = true;
    const small = this.#map.getSize().x < 600;
    this.#quietly(() => this.#map.fitBounds(all, { paddingTopLeft: small ? [30, 40] : [80, 70], paddingBottomRight: small ? [84, 150] : [130, 120], maxZoom: 15.5, animate: !first_time }));
  }

  /// A sea to look at as long as no boat was heard.
  open_sea() { if (!this.#placed) this.#quietly(() => this.#map.setView([27.98, -15.6], 9.5)); }
  /// The view is one of its own choice, not the first.
  loosen() { this.#placed = false; }

  centre(at) { this.#quietly(() => this.#map.setView(at, Math.max(this.#map.getZoom(), 14.5))); }
}
