// The tracking page: one store, and views that follow it.
import { Store } from './store.js';
import { BoatMap } from './map.js';
import { Dial } from './dial.js';
import { Chart } from './chart.js';
import { Ask } from './ask.js';
import { quantities, series } from './quantities.js';
import { FleetPast } from './fleet.js';
import { show_fleet, show_links } from './links.js';
import { t, translate } from './text.js';
import * as place from './place.js';
import * as u from './units.js';

const $ = id => document.getElementById(id);
const set = (id, text) => { const node = $(id); if (node.textContent !== text) node.textContent = text; };
const calm_ms = 1000; // between two drawings of what comes by itself

const store = new Store();
const fleet_past = new FleetPast(() => draw(true));
let shown_at = place.time;    // null: live, else a time of the past
let hovered_at = null;        // pointed at in a chart
let lost_since = null;        // this page lost the server
let drawn_waypoints = '', draw_is_due = false, last_draw = -Infinity, track_is_due = true, playing = null, fitted = place.view ? 'chosen' : 'no';

const follow = on => { map.follow = on; $('follow').setAttribute('aria-pressed', on); };
const map = new BoatMap($('map'), {
  view: place.view,
  on_drag: () => follow(false),
  on_move: by_user => {
    ask.hide();
    if (!by_user || map.follow) return;
    fitted = 'chosen';
    place.remember({ map: place.map_text(...map.where()) });
  },
  on_point: (what, chosen) => {
    if (chosen) ask.choose(what, view()); else ask.hover(what, view());
  },
  on_coarse: key => { $('coarse').hidden = !key; set('coarse', key ? t(key) : ''); },
});
const ask = new Ask($('ask'), store, map, time => pick(time));
const dial = new Dial($('dial'));

const pick = time => { stop_playing(); show_time(time); };
function show_time(time) {
  shown_at = time;
  track_is_due = true;
  if (!playing) place.remember({ t: time === null ? null : new Date(time).toISOString().slice(0, 19) + 'Z' });
  draw(true);
}
const on_hover = time => {
  hovered_at = time;
  const point = time === null ? null : store.at(time);
  map.mark(point);
  draw_charts();
};
const charts = ['left', 'right'].map(side => ({ side, select: $(`${side}-quantity`), chart: new Chart($(`${side}-chart`), { on_pick: pick, on_hover }) }));
for (const { side } of charts) u.allow(side, side === 'left' ? Object.keys(quantities) : ['wind', ...Object.keys(quantities)]);

// What the panel shows: the newest reports, or what the track knows of a moment in the past.
function view() {
  const s = store.state;
  if (shown_at === null) {
    return {
      past: false, fix: s.position, at: s.position?.measured_at ?? null, source: s.position?.source,
      speed: s.position?.speed_over_ground_mps, course: s.position?.course_over_ground_deg,
      heading: s.navigation?.heading_deg, heel: s.navigation?.heel_deg,
      wind: s.wind ?? {}, motion_at: s.navigation?.measured_at,
    };
  }
  const p = store.at(shown_at);
  return {
    past: true, fix: p, at: p?.at ?? null, source: s.sources?.[p?.source], speed: p?.speed_mps, course: p?.course_deg,
    heading: p?.heading_deg, heel: p?.heel_deg,
    wind: { true_speed_mps: p?.wind_speed_mps, true_direction_deg: p?.wind_direction_deg },
  };
}

/// What people do shows at once; what comes by itself, once a second.
function draw(at_once = false) {
  if (draw_is_due && !at_once) return;
  const wait = at_once ? 0 : Math.max(0, last_draw + calm_ms - performance.now());
  draw_is_due = true;
  const go = () => requestAnimationFrame(() => { if (draw_is_due) { draw_is_due = false; last_draw = performance.now(); render(); } });
  if (wait > 0) setTimeout(go, wait); else go();
}

function render() {
  const s = store.state, v = view(), now = store.now(), stale = store.boat_state() === 'stale';
  if (store.boat) { set('boat-name', store.boat); document.title = t('title', { boat: store.boat }); }
  for (const node of document.querySelectorAll('[data-unit=speed]')) node.textContent = u.speed_unit();

  set('sog', u.speed(v.speed)); set('cog', u.degrees(v.course)); set('heading', u.degrees(v.heading));
  set('heel', u.known(v.heel) ? String(Math.round(Math.abs(v.heel))) : '–');
  set('heel-side', u.known(v.heel) && Math.abs(v.heel) >= 0.5 ? t(v.heel > 0 ? 'starboard' : 'port') : '');

  const up = u.known(v.heading) ? v.heading : v.course;
  // Measured from the bow: beside a heading that is newer it says nothing, while the true wind still does.
  const awa = v.wind.measured_at && v.motion_at && Math.abs(v.motion_at - v.wind.measured_at) > 15000 ? null : v.wind.apparent_angle_deg;
  dial.show({ heading: up, apparent_angle: awa, true_direction: v.wind.true_direction_deg });
  set('tws', u.speed(v.wind.true_speed_mps));
  set('twd', u.known(v.wind.true_direction_deg) ? t('from_degrees', { degrees: u.degrees(v.wind.true_direction_deg) }) : '–');
  set('aws', u.known(awa) ? u.speed(v.wind.apparent_speed_mps) : '–');
  set('awa', u.known(awa) ? t('angle_side', { angle: Math.abs(Math.round(awa)), side: t(awa < 0 ? 'port' : 'starboard') }) : '–');

  const next = s.next;
  set('waypoint-name', next ? t('waypoint_of', { name: next.name || t('waypoint_number', { number: next.index + 1 }), number: next.index + 1, count: next.count }) : t('none'));
  set('next-distance', next ? u.distance(next.distance_m) : '–');
  set('next-bearing', next ? `${u.degrees(next.bearing_deg)}°` : '–');
  set('next-eta', !next ? '–' : stale ? t('eta_unknown') : next.eta ? t('eta_moment', { moment: u.moment(next.eta, now), time: u.duration(Math.max(0, next.eta - now)) })
    : u.known(next.closing_mps) && next.closing_mps <= 0.05 ? t('not_nearer') : '–');

  const trip = s.trip, pace = store.pace(), fast = pace.factor > 1.5;
  set('covered', trip ? u.distance(trip.distance_m) : '–');
  set('elapsed', trip ? u.duration(trip.last_at - trip.started_at) : '–');
  set('average', u.known(pace.mean_mps) ? `${u.speed(pace.mean_mps)} ${u.speed_unit()}` : '–');
  $('fast-clock').hidden = !fast;
  set('fast-clock', fast ? t('fast_clock', { factor: Math.round(pace.factor) }) : '');

  set('mode', u.mode_name(s.mode?.mode));
  $('head-mode').hidden = !s.mode?.mode;
  set('head-mode', u.mode_name(s.mode?.mode));
  const power = s.power;
  set('battery', power ? [u.known(power.battery_charge_percent) ? `${Math.round(power.battery_charge_percent)} %` : null,
    u.known(power.battery_voltage_v) ? `${power.battery_voltage_v.toFixed(1)} V` : null,
    u.known(power.battery_current_a) ? `${power.battery_current_a.toFixed(1)} A` : null].filter(Boolean).join(' · ') || '–' : '–');
  $('charge').hidden = !u.known(power?.battery_charge_percent);
  if (!$('charge').hidden) $('charge').value = power.battery_charge_percent;

  document.body.classList.toggle('past', v.past);
  if (fitted === 'no' && s.position || fitted === 'once' && store.whole && store.track.length) {
    map.loosen();
    map.fit(store.track, s.waypoints, s.position, true);
    fitted = store.whole && store.track.length ? 'yes' : 'once';
  } else if (fitted === 'no' && (store.opened || performance.now() > 3000)) map.open_sea();
  if (fitted !== 'once' && (fitted !== 'no' || store.opened)) map.settle();
  const target = s.waypoints?.points?.[s.waypoints.active];
  map.show_boat({ fix: v.fix, heading: v.heading, course: v.course, speed: v.speed, wind_from: v.wind.true_direction_deg, target, past: v.past, time: shown_at, stale: stale && !v.past });
  const waypoints = JSON.stringify([s.waypoints?.points, s.waypoints?.active, u.preferences.lang]);
  if (waypoints !== drawn_waypoints) { drawn_waypoints = waypoints; map.show_waypoints(s.waypoints); }
  if (shown_at === null) fleet_past.forget();
  const fleet = shown_at === null ? store.fleet : fleet_past.at(store.fleet, store.boat_id, shown_at);
  if (store.boat_id) map.show_fleet(fleet, store.boat_id, shown_at ?? now);
  map.show_tiles(store.tiles);
  draw_track();
  render_timeline();
  draw_charts();
  ask.refresh(v);
  tick();
}

function draw_track() {
  const until = shown_at ?? Infinity, end = Math.min(until, store.track.at(-1)?.at ?? 0);
  const top = map.show_track(store, { colour: u.preferences.colour, from: end - u.tail(), until, force: track_is_due });
  track_is_due = false;
  set('legend-low', '0');
  set('legend-high', `${u.speed_value(top).toFixed(1)} ${u.speed_unit()}`);
  $('legend').hidden = store.track.length < 2;
}

function draw_charts() {
  const window = chart_window();
  for (const { side, chart, select } of charts) {
    const name = u.preferences[side];
    if (select.value !== name) select.value = name;
    set(`${side}-unit`, quantities[name].unit());
    chart.show(quantities[name], series(store, name), shown_at, hovered_at, window);
  }
}

// The last of the track as long as the tail is, or what lies around a moment before that.
function chart_window() {
  const first = store.track[0]?.at ?? 0, last = store.track.at(-1)?.at ?? 0, tail = u.tail();
  if (tail === Infinity) return last > first ? [first, last] : null;
  const end = shown_at !== null && shown_at < last - tail ? Math.min(last, shown_at + tail / 2) : last;
  return [Math.max(end - tail, first), end];
}

function render_timeline() {
  const slider = $('slider'), first = store.track[0]?.at, last = store.track.at(-1)?.at;
  slider.disabled = $('play').disabled = !(last > first);
  if (slider.disabled) return;
  if (shown_at !== null && store.whole) shown_at = Math.min(Math.max(shown_at, first), last);
  slider.value = shown_at === null ? 1000 : Math.round(1000 * (shown_at - first) / (last - first));
  slider.style.setProperty('--done', `${slider.value / 10}%`);
  const text = shown_at === null ? t('live') : u.moment(shown_at, store.now());
  slider.setAttribute('aria-valuetext', text);
  set('slider-time', shown_at === null ? u.moment(last, store.now()) : text);
  $('live').setAttribute('aria-pressed', shown_at === null);
}

// What changes with time alone.
function tick() {
  const s = store.state, now = store.now(), server = store.server(), boat = store.boat_state(), v = view();
  set('clock-time', u.clock(now));
  set('clock-zone', u.zone_name());
  const body = document.body.dataset;
  body.server = server;
  body.boat = boat;
  if (server === 'live') lost_since = null;
  else if (server === 'lost') lost_since ??= store.heard_server_at ?? store.started_at;

  set('age', v.at === null ? '–' : v.past ? u.clock(v.at) : t('ago', { time: u.duration(now - v.at) }));
  set('h-position', t(v.past ? 'position_then' : 'last_position'));
  const time = $('fix-time');
  set('fix-time', v.at === null ? t('no_position') : v.past ? t('from_track', { day: u.day(v.at), zone: u.zone_name() }) : t('at', { moment: u.moment(v.at, now) }));
  if (v.at !== null) time.dateTime = new Date(v.at).toISOString(); else time.removeAttribute('datetime');
  set('coordinates', v.fix ? `${u.latitude(v.fix.latitude_deg)}  ${u.longitude(v.fix.longitude_deg)}` : '');
  $('source').hidden = !v.source;
  set('source', v.source ? t('by', { link: u.link_name(v.source) }) : '');
  const rough = v.fix?.circular_error_m;
  $('accuracy').hidden = !(rough > 30);
  set('accuracy', rough > 30 ? t('rough', { distance: u.distance(rough) }) : '');

  // Each group of values says when it is old, on its own, by the rule of its kind and link.
  const reports = { motion: ['position', s.navigation], wind: ['wind', s.wind], next: ['position', s.position], boat: ['power', newer(s.power, s.mode)] };
  for (const [group, [kind, report]] of Object.entries(reports)) {
    const old = !v.past && store.is_stale(kind, report);
    document.querySelector(`[data-live=${group}]`).classList.toggle('old', old);
    if (group === 'motion' || group === 'wind') set(`${group}-age`, old ? t('ago', { time: u.duration(now - report.measured_at) }) : '');
  }

  const shore = show_links($('links'), store, now, server === 'lost');
  $('shore').hidden = !shore;
  set('shore', shore);
  $('fleet').hidden = store.fleet.length < 2;
  if (store.boat_id) show_fleet($('boats'), store.fleet, store.boat_id, now, server === 'lost');
  if (place.embed) glance(v, server, now);
  banner(server, boat, now);
}

const newer = (one, other) => (one?.measured_at ?? 0) >= (other?.measured_at ?? 0) ? one : other;

// All that a frame on another page says.
function glance(v, server, now) {
  set('glance-name', store.boat ?? '–');
  set('glance-age', server === 'lost' ? t('server_lost_short') : v.at === null ? t('waiting_short') : t('ago', { time: u.duration(now - v.at) }));
  set('glance-speed', u.known(v.speed) ? `${u.speed(v.speed)} ${u.speed_unit()}` : '–');
  set('glance-wind', u.known(v.wind.true_speed_mps) ? `${u.speed(v.wind.true_speed_mps)} ${u.speed_unit()}` : '–');
}

function banner(server, boat, now) {
  const s = store.state, last = s.position?.measured_at;
  const nodes = (s.feeds ?? []).find(f => !f.link && !f.connected);
  const down = nodes ? [] : (s.feeds ?? []).filter(f => !f.connected);
  const receiver = down.map(f => t('receiver_lost', { link: u.link_name(f.source), moment: u.moment(f.since, now), detail: f.detail ? ` (${f.detail})` : '' })).join(' ')
    || (nodes ? `${t('shore_lost', { moment: u.moment(nodes.since, now) })}.` : '');
  let pill = t('live'), title = '', text = '', kind = '';
  if (server === 'connecting') pill = t('connecting');
  else if (server === 'lost') {
    pill = t('server_lost');
    kind = 'server';
    title = t(navigator.onLine ? 'page_lost_server' : 'device_offline');
    text = t('server_lost_text', { moment: u.moment(lost_since, now), time: u.duration(now - lost_since) });
  } else if (boat === 'waiting') {
    pill = t('waiting');
    kind = 'boat';
    title = t('no_position_title');
    text = receiver || t('no_position_text');
  } else if (s.position?.source === 'beacon') {
    pill = t('beacon_short');
    kind = 'boat';
    title = t('beacon_title');
    text = t('beacon_text', { moment: u.moment(last, now), time: u.duration(now - last) });
  } else if (boat === 'stale') {
    pill = t('no_current_data');
    kind = 'boat';
    title = t('no_current_data_title');
    text = t('no_current_data_text', { moment: u.moment(last, now), time: u.duration(now - last), reason: receiver || t('listening') });
  }
  set('pill-text', pill);
  const node = $('banner');
  node.hidden = !title;
  node.dataset.kind = kind;
  // Only the title is an alert: a text that ticks would be read out every second.
  set('banner-title', title);
  set('banner-text', text);
}

// Controls
const press = (attribute, value) => {
  for (const button of document.querySelectorAll(`[data-${attribute}]`)) button.setAttribute('aria-pressed', button.dataset[attribute] === value);
};
function apply_preferences() {
  const { units, zone, colour, theme, lang, tail, pace } = u.preferences;
  press('units', units);
  press('zone', zone);
  press('colour', colour);
  $('legend').dataset.by = colour;
  if (document.documentElement.lang !== lang) speak(lang);
  $('tail').value = tail;
  $('pace').value = pace;
  $('lang').value = lang;
  if (theme === 'auto') delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = theme;
  track_is_due = true;
  draw(true);
}
function speak(lang) {
  document.documentElement.lang = lang;
  translate(document);
  for (const heading of document.querySelectorAll('h2')) heading.dataset.now = t('now_suffix');
  for (const { side, select } of charts) {
    select.replaceChildren(...Object.entries(quantities).map(([name, of]) => new Option(of.name(), name)));
    select.setAttribute('aria-label', t('chart_of', { side: t(side) }));
  }
  const frame = new URL(place.boat ? `embed?boat=${encodeURIComponent(place.boat)}` : 'embed', location.href);
  frame.hash = '';
  $('embed-code').value = `<iframe src="${frame}" width="480" height="360" title="${t('embed_title')}"></iframe>`;
  map.rename();
}
for (const name of ['units', 'zone', 'colour'])
  for (const button of document.querySelectorAll(`[data-${name}]`))
    button.addEventListener('click', () => { u.remember({ [name]: button.dataset[name] }); apply_preferences(); });
for (const [name, id] of [['tail', 'tail'], ['pace', 'pace'], ['lang', 'lang'], ['left', 'left-quantity'], ['right', 'right-quantity']])
  $(id).addEventListener('change', event => { u.remember({ [name]: event.target.value }); apply_preferences(); });
$('theme').addEventListener('click', () => {
  const dark = u.preferences.theme === 'auto' ? matchMedia('(prefers-color-scheme: dark)').matches : u.preferences.theme === 'dark';
  u.remember({ theme: dark ? 'light' : 'dark' });
  apply_preferences();
});
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => draw(true));
$('follow').addEventListener('click', () => {
  follow(!map.follow);
  const p = store.state.position;
  if (map.follow && p) map.centre([p.latitude_deg, p.longitude_deg]);
  if (map.follow) place.remember({ map: null });
});
$('fit').addEventListener('click', () => {
  follow(false);
  fitted = 'yes';
  place.remember({ map: null });
  map.fit(store.track, store.state.waypoints, store.state.position);
});
// Everything that makes this view, whatever the reader of the link prefers.
$('share').addEventListener('click', async () => {
  const { units, zone, colour, tail, left, right, lang } = u.preferences;
  place.remember({ map: place.map_text(...map.where()), units, zone, colour, tail, left, right, lang });
  const whole = new URL(place.address(), location.href).href;
  history.replaceState(null, '', whole);
  let copied = true;
  try { await navigator.clipboard.writeText(whole); } catch { copied = false; } // not over plain http
  set('shared', t(copied ? 'shared' : 'not_shared'));
  setTimeout(() => set('shared', ''), 4000);
});
$('slider').addEventListener('input', event => {
  const first = store.track[0].at, last = store.track.at(-1).at, part = Number(event.target.value);
  pick(part >= 1000 ? null : first + (last - first) * part / 1000);
});
$('live').addEventListener('click', () => pick(null));

// The whole tail passes in half a minute, or so many times as fast as it was; then it is live again.
function stop_playing() {
  cancelAnimationFrame(playing);
  playing = null;
  $('play').setAttribute('aria-pressed', false);
}
$('play').addEventListener('click', () => {
  if (playing) { const at = shown_at; stop_playing(); show_time(at); return; }
  const last = store.track.at(-1).at, first = Math.max(store.track[0].at, last - u.tail());
  shown_at ??= first;
  let before = performance.now(), drawn = 0;
  const step = now => {
    const pace = Number(u.preferences.pace) || (last - first) / 30000;
    shown_at += (now - before) * pace;
    before = now;
    if (shown_at >= last) { stop_playing(); show_time(null); return; }
    playing = requestAnimationFrame(step);
    if (now - drawn < 60) return;
    drawn = now;
    track_is_due = true;
    draw(true);
  };
  playing = requestAnimationFrame(step);
  $('play').setAttribute('aria-pressed', true);
});

// What depends on where this page was opened.
for (const link of document.querySelectorAll('[data-file]')) link.href = place.url(link.dataset.file);
document.body.classList.toggle('embed', place.embed);
$('glance').hidden = !place.embed;
$('glance-name').href = place.boat ? encodeURIComponent(place.boat) : '.';
for (const name of ['online', 'offline']) addEventListener(name, () => tick());

let drawn = ''; // the first reports and the track are drawn as they come
store.addEventListener('change', () => {
  const has = `${!!store.state.position} ${store.whole} ${store.opened}`;
  draw(has !== drawn);
  drawn = has;
});
setInterval(() => { store.watch(); if (performance.now() - last_draw > calm_ms) tick(); }, 1000);
document.addEventListener('visibilitychange', () => { if (!document.hidden) { store.watch(); draw(true); } });
speak(u.preferences.lang);
apply_preferences();
store.connect();
