// What the charts can show: from the track's points, or from a history of its own.
import { t } from './text.js';
import { degrees, known, speed_unit, speed_value } from './units.js';

const tenths = value => value.toFixed(1), whole = value => value.toFixed(0), same = value => value;
const quantity = (name, from, colour, more = {}) => ({ name: () => t(name), from, colour, value: same, words: tenths, unit: () => '', ...more });
const fast = { value: speed_value, unit: speed_unit, from_zero: true };
const round = { unit: () => '°', range: [0, 360], ticks: [0, 180, 360], words: degrees, dots: true };

export const quantities = {
  speed: quantity('speed_over_ground', { column: 'speed_mps' }, '--speed', fast),
  wind: quantity('true_wind_speed', { column: 'wind_speed_mps', direction: 'wind_direction_deg' }, '--true-wind', fast),
  wind_direction: quantity('true_wind_direction', { column: 'wind_direction_deg' }, '--true-wind', round),
  course: quantity('course_over_ground', { column: 'course_deg' }, '--speed', round),
  heading: quantity('heading', { column: 'heading_deg' }, '--apparent-wind', round),
  heel: quantity('heel', { column: 'heel_deg' }, '--apparent-wind', { unit: () => '°', words: whole, with_zero: true }),
  battery: quantity('battery_charge_percent', { history: 'battery_charge_percent' }, '--s3', { unit: () => '%', words: whole, range: [0, 100] }),
  voltage: quantity('battery_voltage_v', { history: 'battery_voltage_v' }, '--s3', { unit: () => 'V' }),
  current: quantity('battery_current_a', { history: 'battery_current_a' }, '--s3', { unit: () => 'A', with_zero: true }),
  signal_xbee: quantity('signal_xbee', { history: 'signal_xbee' }, '--l0', { unit: () => 'dBm', words: whole }),
  signal_gprs: quantity('signal_gprs', { history: 'signal_gprs' }, '--l1', { unit: () => 'dBm', words: whole }),
  signal_iridium: quantity('signal_iridium', { history: 'signal_iridium' }, '--l2', { unit: () => 'dBm', words: whole }),
};

/// The values of a quantity, [{at, value, gap}] in the order of time: `gap` where the boat was not heard before it.
/// Kept until the store has new ones.
const kept = new Map();
export function series(store, name) {
  const known_one = kept.get(name);
  if (known_one?.version === store.version) return known_one.all;
  const { column, history } = quantities[name].from, all = [];
  let before = null;
  if (column) {
    const direction = quantities[name].from.direction;
    for (const point of store.track) {
      const value = point[column];
      if (!known(value)) continue;
      all.push({ at: point.at, value, gap: !!before && store.is_gap(before, point), direction: direction ? point[direction] : null });
      before = point;
    }
  } else {
    // Reported once in so many periods, over whichever link: an outage lasts three times as long as is usual.
    const values = store.histories[history] ?? [];
    const steps = values.slice(1).map((v, i) => v.at - values[i].at).sort((a, b) => a - b);
    const long = Math.max(180000, 3 * (steps[Math.floor(steps.length / 2)] ?? 0));
    for (const { at, value } of values) {
      all.push({ at, value, gap: !!before && at - before.at >= long });
      before = { at };
    }
  }
  kept.set(name, { version: store.version, all });
  return all;
}
