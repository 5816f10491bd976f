// A card that tells what is known of a place, a time or a waypoint: while it is pointed at, or as long as it is chosen.
import { t } from './text.js';
import * as u from './units.js';

export class Ask {
  #card; #store; #map; #what = null; #chosen = false;

  /// `go(time)` shows the page as it was then.
  constructor(card, store, map, go) {
    this.#card = card;
    this.#store = store;
    this.#map = map;
    card.querySelector('.close').addEventListener('click', () => this.hide());
    card.querySelector('.title').addEventListener('click', () => { if (this.#what?.kind === 'point') go(this.#what.point.at); });
    addEventListener('keydown', event => { if (event.key === 'Escape') this.hide(); });
  }

  hide() {
    this.#what = null;
    this.#chosen = false;
    this.#card.hidden = true;
    this.#map.mark(null);
  }
  hover(what, view) { if (this.#chosen) return; if (what) this.#show(what, view); else if (this.#what) this.hide(); }
  choose(what, view) {
    if (this.#chosen && what?.kind === 'place') { this.hide(); return; } // a tap beside it closes it
    this.#chosen = !!what;
    if (what) this.#show(what, view); else this.hide();
  }
  refresh(view) { if (this.#what && this.#chosen) this.#show(this.#what, view); }

  #show(what, view) {
    const { title, rows, at } = what.kind === 'waypoint' ? this.#of_waypoint(what, view) : what.kind === 'point' ? this.#of_point(what) : this.#of_place(what, view);
    if (!title) { this.hide(); return; }
    this.#what = what;
    const card = this.#card, heading = card.querySelector('.title');
    heading.textContent = title;
    heading.disabled = what.kind !== 'point';
    card.querySelector('dl').replaceChildren(...rows.filter(row => row && row[1] !== '–').map(([name, value]) => {
      const row = document.createElement('div'), dt = document.createElement('dt'), dd = document.createElement('dd');
      dt.textContent = name;
      dd.textContent = value;
      row.append(dt, dd);
      return row;
    }));
    card.classList.toggle('chosen', this.#chosen);
    card.hidden = false;
    this.#map.mark(at);
    const box = card.parentElement.getBoundingClientRect(), { offsetWidth: w, offsetHeight: h } = card;
    const left = what.at.x + 18 + w < box.width - 8 ? what.at.x + 18 : what.at.x - 18 - w;
    card.style.left = `${Math.max(8, Math.min(left, box.width - w - 8))}px`;
    card.style.top = `${Math.max(8, Math.min(what.at.y - h / 2, box.height - h - 8))}px`;
  }

  #wind(p) { return u.known(p.wind_speed_mps) ? `${u.speed(p.wind_speed_mps)} ${u.speed_unit()}${u.known(p.wind_direction_deg) ? ` ${t('from_degrees', { degrees: u.degrees(p.wind_direction_deg) })}` : ''}` : '–'; }
  #degrees(value) { return u.known(value) ? `${u.degrees(value)}°` : '–'; }
  #coordinates(p) { return `${u.latitude(p.latitude_deg)} ${u.longitude(p.longitude_deg)}`; }
  #from(view, to) {
    if (!view.fix) return '–';
    const { distance_m, bearing_deg } = u.between(view.fix, to);
    return t('bearing_distance', { bearing: u.degrees(bearing_deg), distance: u.distance(distance_m) });
  }

  #of_point({ point }) {
    const { track, state } = this.#store, before = track[this.#store.before(point.at - 1)];
    const gap = before && before.at < point.at && this.#store.is_gap(before, point);
    return { title: u.moment(point.at, this.#store.now()), at: point, rows: [
      [t('speed'), u.known(point.speed_mps) ? `${u.speed(point.speed_mps)} ${u.speed_unit()}` : '–'],
      [t('cog'), this.#degrees(point.course_deg)], [t('heading'), this.#degrees(point.heading_deg)],
      [t('heel'), u.known(point.heel_deg) ? `${Math.abs(Math.round(point.heel_deg))}° ${Math.abs(point.heel_deg) < 0.5 ? '' : t(point.heel_deg > 0 ? 'starboard' : 'port')}` : '–'],
      [t('wind'), this.#wind(point)], [t('by_link'), u.link_name(state.sources?.[point.source])], [t('place'), this.#coordinates(point)],
      gap ? [t('history'), t('gap', { time: u.duration(1000 * (point.silence_s ?? (point.at - before.at) / 1000)) })] : null,
    ] };
  }

  #of_waypoint({ index }, view) {
    const all = this.#store.state.waypoints?.points ?? [], point = all[index];
    if (!point) return {};
    const next = this.#store.state.next?.index === index ? this.#store.state.next : null;
    const title = t('waypoint_of', { name: point.name || t('waypoint_number', { number: index + 1 }), number: index + 1, count: all.length });
    return { title, at: point, rows: [
      [t('from_boat'), this.#from(view, point)], [t('eta'), next?.eta && this.#store.boat_state() === 'current' ? u.moment(next.eta, this.#store.now()) : '–'], [t('place'), this.#coordinates(point)],
    ] };
  }

  #of_place({ latlng }, view) {
    const point = { latitude_deg: latlng.lat, longitude_deg: latlng.lng };
    return { title: this.#coordinates(point), at: point, rows: [[t('from_boat'), this.#from(view, point)]] };
  }
}
