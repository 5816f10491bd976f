// The tracking page: one store, and views that follow it.
import { Store } from './store.js';
import { BoatMap } from './map.js';
import { Dial } from './dial.js';
import { Chart } from './chart.js';
import { show_fleet, show_links } from './links.js';
import * as place from './place.js';
import * as u from './units.js';

const $ = id => document.getElementById(id);
const set = (id, text) => { const node = $(id); if (node.textContent !== text) node.textContent = text; };

const store = new Store();
const follow = on => { map.follow = on; $('follow').setAttribute('aria-pressed', on); };
const map = new BoatMap($('map'), () => follow(false));
const dial = new Dial($('dial'));
let shown_at = null;          // null: live, else a time of the past
let lost_since = null;        // this page lost the server
let drawn_waypoints = '', track_is_drawn = false, draw_is_due = false, last_track_draw = 0, playing = null;

const pick = time => { stop_playing(); shown_at = time; track_is_drawn = false; draw(); };
$('speed-chart').dataset.name = 'Speed over ground';
$('wind-chart').dataset.name = 'True wind speed';
const charts = [
  new Chart($('speed-chart'), { column: 'speed_mps', colour: '--speed', on_pick: pick }),
  new Chart($('wind-chart'), { column: 'wind_speed_mps', direction: 'wind_direction_deg', colour: '--true-wind', on_pick: pick }),
];

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

function draw() {
  if (draw_is_due) return;
  draw_is_due = true;
  requestAnimationFrame(() => { draw_is_due = false; render(); });
}

function render() {
  const s = store.state, v = view(), now = store.now(), stale = store.boat_state() === 'stale';
  if (store.boat) { set('boat-name', store.boat); document.title = `${store.boat} · live tracking`; }
  for (const node of document.querySelectorAll('[data-unit=speed]')) node.textContent = u.speed_unit();

  set('sog', u.speed(v.speed)); set('cog', u.degrees(v.course)); set('heading', u.degrees(v.heading));
  set('heel', u.known(v.heel) ? String(Math.round(Math.abs(v.heel))) : '–');
  set('heel-side', u.known(v.heel) && Math.abs(v.heel) >= 0.5 ? (v.heel > 0 ? 'starboard' : 'port') : '');

  const up = u.known(v.heading) ? v.heading : v.course;
  // Measured from the bow: beside a heading that is newer it says nothing, while the true wind still does.
  const awa = v.wind.measured_at && v.motion_at && Math.abs(v.motion_at - v.wind.measured_at) > 15000 ? null : v.wind.apparent_angle_deg;
  dial.show({ heading: up, apparent_angle: awa, true_direction: v.wind.true_direction_deg });
  set('tws', u.speed(v.wind.true_speed_mps));
  set('twd', u.known(v.wind.true_direction_deg) ? `from ${u.degrees(v.wind.true_direction_deg)}°` : '–');
  set('aws', u.known(awa) ? u.speed(v.wind.apparent_speed_mps) : '–');
  set('awa', u.known(awa) ? `${Math.abs(Math.round(awa))}° ${awa < 0 ? 'port' : 'starboard'}` : '–');

  const next = s.next;
  set('waypoint-name', next ? `${next.name || `WP${next.index + 1}`} · ${next.index + 1} of ${next.count}` : 'none');
  set('next-distance', next ? u.distance(next.distance_m) : '–');
  set('next-bearing', next ? `${u.degrees(next.bearing_deg)}°` : '–');
  set('next-eta', !next ? '–' : stale ? 'unknown, no data' : next.eta ? `${u.moment(next.eta, now)} · in ${u.duration(Math.max(0, next.eta - now))}`
    : u.known(next.closing_mps) && next.closing_mps <= 0.05 ? 'not getting nearer' : '–');

  const trip = s.trip, elapsed = trip ? trip.last_at - trip.started_at : null;
  set('covered', trip ? u.distance(trip.distance_m) : '–');
  set('elapsed', trip ? u.duration(elapsed) : '–');
  set('average', trip && elapsed > 0 ? `${u.speed(trip.distance_m / elapsed * 1000)} ${u.speed_unit()}` : '–');

  set('mode', s.mode?.mode || '–');
  const power = s.power;
  set('battery', power ? [u.known(power.battery_charge_percent) ? `${Math.round(power.battery_charge_percent)} %` : null,
    u.known(power.battery_voltage_v) ? `${power.battery_voltage_v.toFixed(1)} V` : null,
    u.known(power.battery_current_a) ? `${power.battery_current_a.toFixed(1)} A` : null].filter(Boolean).join(' · ') || '–' : '–');
  $('charge').hidden = !u.known(power?.battery_charge_percent);
  if (!$('charge').hidden) $('charge').value = power.battery_charge_percent;

  document.body.classList.toggle('past', v.past);
  const target = s.waypoints?.points?.[s.waypoints.active];
  map.show_boat({ fix: v.fix, heading: v.heading, course: v.course, speed: v.speed, wind_from: v.wind.true_direction_deg, target, past: v.past, stale: stale && !v.past });
  const waypoints = JSON.stringify([s.waypoints?.points, s.waypoints?.active]);
  if (waypoints !== drawn_waypoints) { drawn_waypoints = waypoints; map.show_waypoints(s.waypoints); }
  if (store.boat_id) map.show_fleet(store.fleet, store.boat_id, now);
  if (!track_is_drawn && performance.now() - last_track_draw > (playing ? 60 : 400)) draw_track();
  map.fit(store.track, s.waypoints, true);
  render_timeline();
  const window = chart_window();
  for (const chart of charts) chart.show(store.track, shown_at, window);
  tick();
}

function draw_track() {
  track_is_drawn = true;
  last_track_draw = performance.now();
  const until = shown_at ?? Infinity, end = Math.min(until, store.track.at(-1)?.at ?? 0);
  const top = map.show_track(store.track, { colour: u.preferences.colour, from: end - u.tail(), until, sources: store.state.sources });
  set('legend-low', '0');
  set('legend-high', `${u.speed_value(top).toFixed(1)} ${u.speed_unit()}`);
  $('legend').hidden = store.track.length < 2;
}

// The last of the track as long as the tail is, or what lies around a moment before that.
function chart_window() {
  const last = store.track.at(-1)?.at ?? 0, tail = u.tail();
  if (tail === Infinity) return null;
  const end = shown_at !== null && shown_at < last - tail ? Math.min(last, shown_at + tail / 2) : last;
  return [Math.max(end - tail, store.track[0]?.at ?? 0), end];
}

function render_timeline() {
  const slider = $('slider'), first = store.track[0]?.at, last = store.track.at(-1)?.at;
  slider.disabled = $('play').disabled = !(last > first);
  if (slider.disabled) return;
  if (shown_at !== null) shown_at = Math.min(Math.max(shown_at, first), last);
  slider.value = shown_at === null ? 1000 : Math.round(1000 * (shown_at - first) / (last - first));
  slider.style.setProperty('--done', `${slider.value / 10}%`);
  const text = shown_at === null ? `Live` : u.moment(shown_at, store.now());
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

  set('age', v.at === null ? '–' : v.past ? u.clock(v.at) : `${u.duration(now - v.at)} ago`);
  set('h-position', v.past ? 'Position then' : 'Last position');
  const time = $('fix-time');
  set('fix-time', v.at === null ? 'No position received yet' : v.past ? `${u.day(v.at)}, ${u.zone_name()} · shown from the track` : `at ${u.moment(v.at, now)}`);
  if (v.at !== null) time.dateTime = new Date(v.at).toISOString(); else time.removeAttribute('datetime');
  set('coordinates', v.fix ? `${u.latitude(v.fix.latitude_deg)}  ${u.longitude(v.fix.longitude_deg)}` : '');
  $('source').hidden = !v.source;
  set('source', v.source ? `by ${u.link_name(v.source)}` : '');
  const rough = v.fix?.circular_error_m;
  $('accuracy').hidden = !(rough > 30);
  set('accuracy', rough > 30 ? `Rough position: within about ${u.distance(rough)}` : '');

  // Each group of values says when it is old, on its own.
  for (const [name, at] of [['motion', v.motion_at], ['wind', v.wind.measured_at]]) {
    const old = !v.past && u.known(at) && now - at > store.stale_after_ms;
    set(`${name}-age`, old ? `${u.duration(now - at)} ago` : '');
  }
  // Battery and mode are reported more rarely than positions.
  for (const [group, at, patience] of [['motion', s.position?.measured_at, 1], ['wind', s.wind?.measured_at, 1], ['next', s.position?.measured_at, 1],
    ['boat', Math.max(s.power?.measured_at ?? 0, s.mode?.measured_at ?? 0), 5]])
    document.querySelector(`[data-live=${group}]`).classList.toggle('old', !v.past && at > 0 && now - at > patience * store.stale_after_ms);

  const shore = show_links($('links'), s, now, server === 'lost');
  $('shore').hidden = !shore;
  set('shore', shore);
  $('fleet').hidden = store.fleet.length < 2;
  if (store.boat_id) show_fleet($('boats'), store.fleet, store.boat_id, now, server === 'lost');
  if (place.embed) glance(v, boat, server, now);
  banner(server, boat, now);
}

// All that a frame on another page says.
function glance(v, boat, server, now) {
  set('glance-name', store.boat ?? 'A-Tirma');
  set('glance-age', server === 'lost' ? 'server lost' : v.at === null ? 'waiting' : `${u.duration(now - v.at)} ago`);
  set('glance-speed', u.known(v.speed) ? `${u.speed(v.speed)} ${u.speed_unit()}` : '–');
  set('glance-wind', u.known(v.wind.true_speed_mps) ? `${u.speed(v.wind.true_speed_mps)} ${u.speed_unit()}` : '–');
}

function banner(server, boat, now) {
  const s = store.state, last = s.position?.measured_at;
  const nodes = (s.feeds ?? []).find(f => !f.link && !f.connected);
  const down = nodes ? [] : (s.feeds ?? []).filter(f => !f.connected);
  const receiver = down.map(f => `The receiver of ${u.link_name(f.source)} is not connected since ${u.moment(f.since, now)}${f.detail ? ` (${f.detail})` : ''}.`).join(' ')
    || (nodes ? `No connection to the shore station since ${u.moment(nodes.since, now)}.` : '');
  let pill = 'Live', title = '', text = '', kind = '';
  if (server === 'connecting') pill = 'Connecting…';
  else if (server === 'lost') {
    pill = 'Server lost';
    kind = 'server';
    title = navigator.onLine ? 'This page lost the server' : 'This device is offline';
    text = `Nothing heard from it since ${u.moment(lost_since, now)}, ${u.duration(now - lost_since)} ago. The boat may be fine; what you see is old. Trying again…`;
  } else if (boat === 'waiting') {
    pill = 'Waiting for the boat';
    kind = 'boat';
    title = 'No position yet';
    text = receiver || 'The server is running and has not heard from the boat so far.';
  } else if (boat === 'stale') {
    pill = 'No current data';
    kind = 'boat';
    title = 'No current data from the boat';
    text = `The server has no newer position since ${u.moment(last, now)}, ${u.duration(now - last)} ago. ${receiver || 'It is listening.'}`;
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
  press('units', u.preferences.units);
  press('zone', u.preferences.zone);
  press('colour', u.preferences.colour);
  $('legend').dataset.by = u.preferences.colour;
  $('tail').value = u.preferences.tail;
  if (u.preferences.theme === 'auto') delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = u.preferences.theme;
  track_is_drawn = false;
  last_track_draw = 0;
  draw();
}
for (const name of ['units', 'zone', 'colour'])
  for (const button of document.querySelectorAll(`[data-${name}]`))
    button.addEventListener('click', () => { u.remember({ [name]: button.dataset[name] }); apply_preferences(); });
$('theme').addEventListener('click', () => {
  const dark = u.preferences.theme === 'auto' ? matchMedia('(prefers-color-scheme: dark)').matches : u.preferences.theme === 'dark';
  u.remember({ theme: dark ? 'light' : 'dark' });
  apply_preferences();
});
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
$('follow').addEventListener('click', () => {
  follow(!map.follow);
  const p = store.state.position;
  if (map.follow && p) map.centre([p.latitude_deg, p.longitude_deg]);
});
$('fit').addEventListener('click', () => { follow(false); map.fit(store.track, store.state.waypoints); });
$('tail').addEventListener('change', () => { u.remember({ tail: $('tail').value }); apply_preferences(); });
$('slider').addEventListener('input', event => {
  const first = store.track[0].at, last = store.track.at(-1).at, part = Number(event.target.value);
  pick(part >= 1000 ? null : first + (last - first) * part / 1000);
});
$('live').addEventListener('click', () => pick(null));

// The whole tail passes in half a minute, then it is live again.
function stop_playing() {
  cancelAnimationFrame(playing);
  playing = null;
  $('play').setAttribute('aria-pressed', false);
}
$('play').addEventListener('click', () => {
  if (playing) return stop_playing();
  const last = store.track.at(-1).at, first = Math.max(store.track[0].at, last - u.tail());
  shown_at ??= first;
  let before = performance.now();
  const step = now => {
    shown_at += (now - before) / 30000 * (last - first);
    before = now;
    track_is_drawn = false;
    if (shown_at >= last) { shown_at = null; stop_playing(); } else playing = requestAnimationFrame(step);
    draw();
  };
  playing = requestAnimationFrame(step);
  $('play').setAttribute('aria-pressed', true);
});

// What depends on where this page was opened.
for (const link of document.querySelectorAll('[data-file]')) link.href = place.url(link.dataset.file);
document.body.classList.toggle('embed', place.embed);
$('glance').hidden = !place.embed;
$('glance-name').href = place.boat ? encodeURIComponent(place.boat) : '.';
const frame = new URL(place.boat ? `embed?boat=${encodeURIComponent(place.boat)}` : 'embed', location.href);
$('embed-code').value = `<iframe src="${frame}" width="480" height="360" title="Live position of the boat"></iframe>`;
for (const name of ['online', 'offline']) addEventListener(name, () => tick());

store.addEventListener('change', () => { track_is_drawn = false; draw(); });
setInterval(() => { store.watch(); tick(); if (!track_is_drawn) draw(); }, 1000);
document.addEventListener('visibilitychange', () => { if (!document.hidden) { store.watch(); draw(); } });
apply_preferences();
fetch('boats.json').then(answer => answer.json()).then(told => { store.fleet = told.boats; draw(); }).catch(() => { /* the stream tells it again */ });
store.connect();
