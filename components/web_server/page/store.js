// What the page knows: the newest reports first, then the track, then the server's event stream goes on.
import { url } from './place.js';
import { known } from './units.js';

const usual = [20, 60]; // of a link that the server does not know
const least_gap_ms = 180000; // a shorter silence is no outage on map and charts, whatever the link's period

export class Store extends EventTarget {
  state = {};
  track = [];          // rows as objects, in the order of time
  histories = {};      // of quantities that are not reported with positions: [{at, value}]
  version = 0;         // of track and histories
  boat = null;
  boat_id = null;
  fleet = [];          // all boats of this server, where there are several
  tiles = null;
  epoch = null;
  last_event_id = '';
  status_period_ms = 5000;
  heard_server_at = null; // server's time
  started_at = Date.now();
  opened = false;
  whole = false;       // the track is here
  #columns = [];
  #max_points = 3000;
  #offsets = [];
  #source = null;
  #retry_ms = 1000;
  #retry_timer = null;
  #asking = false;
  #last_message = Date.now(); // this machine's time, for the watchdog only

  /// The server's clock, whatever this machine's says: the sample with the least delay of the last ones.
  now() { return Date.now() + (this.#offsets.length ? Math.max(...this.#offsets) : 0); }

  /// 'connecting' before the first message, then 'live' or 'lost'.
  server() {
    if (this.opened && Date.now() - this.#last_message < 3 * this.status_period_ms) return 'live';
    return this.heard_server_at === null && Date.now() - this.started_at < 8000 ? 'connecting' : 'lost';
  }

  /// Up to which age a value of that kind is fresh and from which on stale, in milliseconds: the server's word, which
  /// follows the period of the link.
  limits(kind, source) {
    const [fresh, stale] = this.state.freshness?.[source]?.[kind] ?? usual;
    return { fresh: fresh * 1000, stale: stale * 1000 };
  }
  is_stale(kind, report) { return !!report && this.now() - report.measured_at >= this.limits(kind, report.source).stale; }

  /// 'waiting' for a first position, 'current' or 'stale'.
  boat_state() { return !this.state.position ? 'waiting' : this.is_stale('position', this.state.position) ? 'stale' : 'current'; }

  /// Whether the boat was not heard between a point and the one before it.
  is_gap(before, point) {
    const silence = 1000 * (point.silence_s ?? (point.at - before.at) / 1000);
    const [one, other] = [before, point].map(p => this.limits('position', this.state.sources?.[p.source]).stale);
    return silence >= Math.max(least_gap_ms, one, other);
  }

  async connect() {
    clearTimeout(this.#retry_timer);
    this.#source?.close();
    if (this.last_event_id) return this.#follow();
    if (this.#asking) return;
    this.#asking = true;
    try {
      this.#newest(await ask('now.json'));
      this.#follow();
      this.#whole_track(await ask('track.json'));
    } catch {
      if (!this.opened || !this.whole) this.#reconnect_later();
    } finally {
      this.#asking = false;
    }
  }

  #follow() {
    const source = this.#source = new EventSource(`${url('events')}?last=${this.last_event_id}`);
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
    if (!this.whole) this.last_event_id = ''; // from the beginning
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

  #introduce(data) {
    if (data.epoch !== this.epoch) this.#forget();
    this.epoch = data.epoch;
    this.boat = data.boat;
    this.boat_id = data.boat_id;
    this.status_period_ms = data.status_period_s * 1000;
    this.#columns = data.columns;
    this.#max_points = data.max_points;
    this.state = data.state;
    this.#note_histories(data.state);
  }
  #forget() { this.track = []; this.histories = {}; ++this.version; }

  #newest(data) {
    this.#introduce(data);
    if (data.boats) this.fleet = data.boats.boats;
    this.tiles = data.tiles ?? null;
    this.last_event_id = data.id;
    this.#hear(data.now);
    this.#changed();
  }

  #whole_track(data) {
    if (data.epoch !== this.epoch) throw new Error(data.epoch); // the server has started again meanwhile
    const columns = Object.entries(data.columns).map(([name, packed]) => [name, unpack(packed)]);
    const points = columns[0][1].map((_, i) => Object.fromEntries(columns.map(([name, values]) => [name, values[i]])));
    const late = this.track; // what the stream brought before
    this.track = points;
    for (const point of late) this.#place(point);
    for (const [name, packed] of Object.entries(data.histories)) {
      const at = unpack(packed.at), value = unpack(packed.value), last = at.at(-1) ?? -Infinity;
      const since = (this.histories[name] ?? []).filter(p => p.at > last);
      this.histories[name] = at.map((time, i) => ({ at: time, value: value[i] })).concat(since);
    }
    this.whole = true;
    ++this.version;
    this.#changed();
  }

  #snapshot(data) {
    this.#introduce(data);
    if (!data.partial) { this.#forget(); this.whole = true; }
    this.#add(data.points);
    this.#changed();
  }

  #update(data) {
    Object.assign(this.state, data.state);
    this.#note_histories(data.state);
    if (data.points) this.#add(data.points);
    this.#changed();
  }

  #note_histories(state) {
    const note = (name, at, value) => {
      const all = this.histories[name] ??= [];
      if (!known(value) || !(at > (all.at(-1)?.at ?? -Infinity))) return;
      all.push({ at, value });
      ++this.version;
    };
    for (const name of ['battery_charge_percent', 'battery_voltage_v', 'battery_current_a'])
      if (state.power) note(name, state.power.measured_at, state.power[name]);
    for (const [link, signal] of Object.entries(state.signal ?? {})) note(`signal_${link}`, signal.measured_at, signal.rssi_dbm);
  }

  #add(rows) {
    for (const row of rows) this.#place(Object.fromEntries(this.#columns.map((name, i) => [name, row[i]])));
    if (rows.length) ++this.version;
    // The server thins the track in its own way: ask for that one when this one has grown too long.
    if (this.track.length > 2 * this.#max_points && rows.length < this.#max_points) {
      this.last_event_id = '';
      this.#forget();
      this.whole = false;
      this.connect();
    }
  }

  #place(point) {
    const last = this.track.at(-1);
    if (!last || point.at > last.at) { this.track.push(point); return; }
    let low = 0, high = this.track.length; // history: to its place, or over its former self
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.track[middle].at < point.at) low = middle + 1; else high = middle;
    }
    const same = this.track[low]?.at === point.at;
    this.track.splice(low, same ? 1 : 0, point);
    const after = this.track[low + 1];
    if (!same && after) after.silence_s = Math.min(after.silence_s ?? Infinity, (after.at - point.at) / 1000);
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

  /// The mean of the reported speeds, and how much further the boat came than these say: its clock runs that much
  /// faster than time, as a simulated one may.
  pace() {
    if (this.#paced?.mean_mps && (this.#paced.version === this.version || performance.now() - this.#paced.made < 5000)) return this.#paced;
    let sum = 0, time = 0, way = 0;
    for (let i = 1; i < this.track.length; ++i) {
      const a = this.track[i - 1], b = this.track[i], ms = b.at - a.at;
      if (!known(a.speed_mps) || is_rough(a) || is_rough(b) || this.is_gap(a, b)) continue;
      sum += a.speed_mps * ms;
      time += ms;
      const north = (b.latitude_deg - a.latitude_deg) * 111195;
      way += Math.hypot(north, (b.longitude_deg - a.longitude_deg) * 111195 * Math.cos(a.latitude_deg * Math.PI / 180));
    }
    return this.#paced = { version: this.version, made: performance.now(), mean_mps: time ? sum / time : null, factor: sum > 100000 ? way / (sum / 1000) : 1 };
  }
  #paced = null;
}

async function ask(name) {
  const answer = await fetch(url(name));
  if (!answer.ok) throw new Error(`${answer.status}`);
  return answer.json();
}

/// [scale, differences] into numbers.
export function unpack([scale, steps]) {
  let sum = 0;
  return steps.map(step => step === null ? null : (sum += step) / scale);
}

/// Such as where the Iridium gateway believed the boat to be.
export const is_rough = point => point?.circular_error_m > 200;
