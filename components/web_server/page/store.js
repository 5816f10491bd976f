// What the page knows, fed by the server's event stream.
import { url } from './place.js';

export class Store extends EventTarget {
  state = {};
  track = [];          // rows as objects, in the order of time
  boat = null;
  boat_id = null;
  fleet = [];          // all boats of this server, where there are several
  epoch = null;
  last_event_id = '';
  stale_after_ms = 60000;
  status_period_ms = 5000;
  heard_server_at = null; // server's time
  started_at = Date.now();
  opened = false;
  #columns = [];
  #max_points = 3000;
  #offsets = [];
  #source = null;
  #retry_ms = 1000;
  #retry_timer = null;
  #last_message = Date.now(); // this machine's time, for the watchdog only

  /// The server's clock, whatever this machine's says: the sample with the least delay of the last ones.
  now() { return Date.now() + (this.#offsets.length ? Math.max(...this.#offsets) : 0); }

  /// 'connecting' before the first message, then 'live' or 'lost'.
  server() {
    if (this.opened && Date.now() - this.#last_message < 3 * this.status_period_ms) return 'live';
    return this.heard_server_at === null && Date.now() - this.started_at < 8000 ? 'connecting' : 'lost';
  }

  /// 'waiting' for a first position, 'current' or 'stale'.
  boat_state() {
    const fix = this.state.position;
    if (!fix) return 'waiting';
    return this.now() - fix.measured_at > this.stale_after_ms ? 'stale' : 'current';
  }

  connect() {
    this.#source?.close();
    clearTimeout(this.#retry_timer);
    const query = this.last_event_id ? `?last=${this.last_event_id}` : '';
    const source = this.#source = new EventSource(url('events') + query);
    this.#last_message = Date.now();
    const on = (name, handle) => source.addEventListener(name, event => {
      let data;
      try { data = JSON.parse(event.data); } catch { return; }
      if (event.lastEventId) this.last_event_id = event.lastEventId;
      this.#hear(data.now);
      handle(data);
    });
    on('snapshot', data => this.#snapshot(data));
    on('update', data => this.#update(data));
    on('status', data => this.#update(data));
    on('fleet', data => { this.fleet = data.boats; this.#changed(); });
    source.onerror = () => {
      if (source !== this.#source) return;
      if (this.opened) { this.opened = false; this.#changed(); }
      // The browser tries again by itself, except after an answer such as 503.
      if (source.readyState === EventSource.CLOSED) this.#reconnect_later();
    };
  }

  /// To be called every second: a stream that is open but silent is dead too.
  watch() {
    if (this.opened && Date.now() - this.#last_message > 3 * this.status_period_ms) {
      this.opened = false;
      this.#reconnect_later();
      this.#changed();
    }
  }

  #reconnect_later() {
    this.#source?.close();
    clearTimeout(this.#retry_timer);
    this.#retry_timer = setTimeout(() => this.connect(), this.#retry_ms * (0.75 + Math.random() / 2));
    this.#retry_ms = Math.min(15000, this.#retry_ms * 2);
  }

  #hear(server_now) {
    if (Number.isFinite(server_now)) {
      this.#offsets.push(server_now - Date.now());
      if (this.#offsets.length > 12) this.#offsets.shift();
      this.heard_server_at = server_now;
    }
    this.#last_message = Date.now();
    this.#retry_ms = 1000;
    this.opened = true;
  }

  #snapshot(data) {
    if (!data.partial || data.epoch !== this.epoch) this.track = [];
    this.epoch = data.epoch;
    this.boat = data.boat;
    this.boat_id = data.boat_id;
    this.stale_after_ms = data.stale_after_s * 1000;
    this.status_period_ms = data.status_period_s * 1000;
    this.#columns = data.columns;
    this.#max_points = data.max_points;
    this.state = data.state;
    this.#add(data.points);
    this.#changed();
  }

  #update(data) {
    Object.assign(this.state, data.state);
    if (data.points) this.#add(data.points);
    this.#changed();
  }

  #add(rows) {
    for (const row of rows) {
      const point = Object.fromEntries(this.#columns.map((name, i) => [name, row[i]]));
      const last = this.track.at(-1);
      if (!last || point.at > last.at) { this.track.push(point); continue; }
      let low = 0, high = this.track.length; // history: to its place, or over its former self
      while (low < high) {
        const middle = (low + high) >> 1;
        if (this.track[middle].at < point.at) low = middle + 1; else high = middle;
      }
      this.track.splice(low, this.track[low]?.at === point.at ? 1 : 0, point);
    }
    // The server thins the track in its own way: ask for that one when this one has grown too long.
    if (this.track.length > 2 * this.#max_points && rows.length < this.#max_points) {
      this.last_event_id = '';
      this.connect();
    }
  }

  #changed() { this.dispatchEvent(new Event('change')); }

  /// The last point at or before a time; a rough fix only where nothing better is near.
  at(time) {
    let i = this.before(time);
    const rough = this.track[i];
    while (i > 0 && is_rough(this.track[i]) && rough.at - this.track[i - 1].at < 600000) --i;
    return is_rough(this.track[i]) ? rough ?? null : this.track[i] ?? null;
  }

  /// Its index; the first where there is none.
  before(time) {
    let low = 0, high = this.track.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.track[middle].at <= time) low = middle + 1; else high = middle;
    }
    return Math.max(0, low - 1);
  }
}

/// Such as where the Iridium gateway believed the boat to be.
export const is_rough = point => point?.circular_error_m > 200;
