// A small time chart on a canvas: one quantity as an area or as dots, a cursor, and wind arrows if asked for.
import { t } from './text.js';
import { day, hour_minute, minute_second, of_day_ms, zone_name } from './units.js';

const steps_s = [10, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400, 172800, 604800, 1209600, 2592000];
const day_ms = 86400000;

function nice(span) { // a round number that is no smaller
  const power = 10 ** Math.floor(Math.log10(span));
  for (const one of [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10]) if (one * power >= span * 0.999) return one * power;
  return 10 * power;
}

export class Chart {
  /// `on_pick(time)` by pressing, `on_hover(time or null)` by pointing.
  constructor(canvas, { on_pick, on_hover }) {
    Object.assign(this, { canvas, quantity: null, all: [], cursor: null, hover: null, window: null });
    new ResizeObserver(() => this.draw()).observe(canvas);
    const time = event => this.time_at(event.clientX - canvas.getBoundingClientRect().left);
    canvas.addEventListener('pointerdown', event => { if (this.range) { canvas.setPointerCapture(event.pointerId); on_pick(time(event)); } });
    canvas.addEventListener('pointermove', event => {
      if (!this.range) return;
      if (event.buttons) on_pick(time(event));
      else on_hover(time(event));
    });
    canvas.addEventListener('pointerleave', () => on_hover(null));
  }

  /// `all`: [{at, value, gap, direction}]; `window`: [from, to] in milliseconds; cursor and hover are times or null.
  show(quantity, all, cursor, hover, window) {
    Object.assign(this, { quantity, all, cursor, hover, window });
    this.draw();
  }

  time_at(x) {
    const { left, width } = this.area, [from, to] = this.range;
    return from + (to - from) * Math.min(1, Math.max(0, (x - left) / width));
  }

  draw() {
    const { canvas, quantity } = this;
    const w = canvas.clientWidth, h = canvas.clientHeight, ratio = devicePixelRatio || 1;
    if (!w || !h || !quantity) return;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    const all = this.window ? this.all.filter(p => p.at >= this.window[0] && p.at <= this.window[1]) : this.all;
    const g = canvas.getContext('2d');
    const style = getComputedStyle(canvas), css = name => style.getPropertyValue(name).trim();
    const size = parseFloat(style.fontSize);
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, w, h);
    g.font = `${size}px ${style.fontFamily}`;
    const arrows = !!quantity.from.direction, top = arrows ? 20 : 8, left = size * 3.1;
    const area = this.area = { left, top, width: w - left - 10, height: h - top - size * 1.7 };
    if (all.length < 2) {
      g.fillStyle = css('--ink-3');
      g.textAlign = 'center';
      g.fillText(t('nothing_to_draw'), w / 2, h / 2);
      this.range = null;
      canvas.setAttribute('aria-label', t('chart_empty', { name: quantity.name() }));
      return;
    }
    const from = Number.isFinite(this.window?.[0]) ? this.window[0] : all[0].at;
    const to = Math.max(this.window?.[1] ?? 0, all.at(-1).at, from + 1000);
    this.range = [from, to];
    let least = Infinity, most = -Infinity;
    for (const { value } of all) { least = Math.min(least, value); most = Math.max(most, value); }
    let [low, high] = (quantity.range ?? [least, most]).map(quantity.value);
    if (!quantity.range) {
      if (quantity.from_zero) { low = 0; high = nice(Math.max(high, 0.5) * 1.05); } else {
        if (quantity.with_zero) { low = Math.min(0, low); high = Math.max(0, high); }
        const step = nice(Math.max(high - low, 0.2) * 1.1) / 2;
        low = Math.floor(low / step) * step;
        high = Math.max(low + step, Math.ceil(high / step) * step);
      }
    }
    const x = at => area.left + area.width * (at - from) / (to - from);
    const y = value => area.top + area.height * (1 - (quantity.value(value) - low) / (high - low));

    g.lineWidth = 1;
    g.textAlign = 'right';
    g.textBaseline = 'middle';
    for (const part of [0, 0.5, 1]) {
      const at = Math.round(area.top + area.height * (1 - part)) + 0.5;
      g.strokeStyle = css('--grid');
      g.beginPath(); g.moveTo(area.left, at); g.lineTo(area.left + area.width, at); g.stroke();
      g.fillStyle = css('--ink-3');
      g.fillText(String(+(low + (high - low) * part).toFixed(2)), area.left - 6, at);
    }
    this.#time_axis(g, x, from, to, w, h, size);

    const colour = css(quantity.colour); // #rrggbb: an alpha is put behind it
    // At most some points a pixel are drawn; a silence is a gap, not a slope.
    const runs = [];
    let run = null;
    for (const point of all) {
      if (!run || point.gap) runs.push(run = []);
      const px = x(point.at), py = y(point.value), last = run.at(-1);
      if (last && !quantity.dots && px - last[0] < 0.7) last[1] = (last[1] * last[2] + py) / ++last[2]; else run.push([px, py, 1]);
    }
    if (quantity.dots) {
      g.fillStyle = colour;
      for (const points of runs) for (const [px, py] of points) g.fillRect(px - 1, py - 1, 2, 2);
    } else {
      const fade = g.createLinearGradient(0, area.top, 0, area.top + area.height);
      fade.addColorStop(0, `${colour}60`);
      fade.addColorStop(1, `${colour}08`);
      const ground = quantity.with_zero && low < 0 ? y(0) : area.top + area.height;
      for (const points of runs) {
        g.beginPath();
        points.forEach(([px, py], i) => i ? g.lineTo(px, py) : g.moveTo(px, py));
        if (points.length === 1) g.lineTo(points[0][0] + 1, points[0][1]);
        g.strokeStyle = colour; g.lineWidth = 1.6; g.lineJoin = 'round';
        g.stroke();
        g.lineTo(points.at(-1)[0], ground);
        g.lineTo(points[0][0], ground);
        g.fillStyle = fade;
        g.fill();
      }
    }
    if (arrows) this.#arrows(g, all, x, css);
    for (const [at, words] of [[this.cursor, false], [this.hover, true]]) if (at !== null) this.#cursor(g, at, words, all, x, y, css, colour, size);
    const say = value => quantity.words(quantity.value(value));
    canvas.setAttribute('aria-label', t('chart_words', {
      name: quantity.name(), low: say(least), high: say(most), unit: quantity.unit(), from: hour_minute(from), to: hour_minute(to), zone: zone_name(), last: say(all.at(-1).value),
    }));
  }

  /// Round times of the chosen zone, which stands at its beginning; days where the chart spans more than one.
  #time_axis(g, x, from, to, w, h, size) {
    g.textBaseline = 'alphabetic';
    g.textAlign = 'left';
    g.fillText(zone_name(), 0, h - 5);
    const { left } = this.area;
    const after = Math.max(left + 8, g.measureText(zone_name()).width + size * 1.8);
    g.textAlign = 'center';
    const step = 1000 * (steps_s.find(s => (to - from) / 1000 / s <= Math.max(2, w / (7.5 * size))) ?? 2592000);
    const start = from - of_day_ms(from);
    for (let at = start + Math.ceil((from - start) / step) * step; at <= to; at += step) {
      const px = x(at);
      if (px < after || px > w - size * 1.5) continue;
      g.fillText(step >= day_ms || (to - from > day_ms / 2 && of_day_ms(at) === 0) ? day(at) : step < 60000 ? minute_second(at) : hour_minute(at), px, h - 5);
    }
  }

  #arrows(g, all, x, css) {
    g.strokeStyle = g.fillStyle = css('--ink-2');
    g.lineWidth = 1.3;
    let next = this.area.left + 12;
    for (const point of all) {
      const px = x(point.at);
      if (px < next || typeof point.direction !== 'number') continue;
      next = px + 34;
      g.save();
      g.translate(px, 9);
      g.rotate(point.direction * Math.PI / 180); // drawn as blowing from up to down
      g.beginPath(); g.moveTo(0, -7); g.lineTo(0, 4); g.stroke();
      g.beginPath(); g.moveTo(0, 7); g.lineTo(-3.2, 1); g.lineTo(3.2, 1); g.fill();
      g.restore();
    }
  }

  #cursor(g, at, words, all, x, y, css, colour, size) {
    const point = all.findLast(p => p.at <= at);
    const px = Math.round(x(at)) + 0.5;
    g.strokeStyle = css('--ink-2'); g.lineWidth = 1;
    if (words) g.setLineDash([3, 3]);
    g.beginPath(); g.moveTo(px, this.area.top); g.lineTo(px, this.area.top + this.area.height); g.stroke();
    g.setLineDash([]);
    if (!point) return;
    const py = y(point.value);
    g.beginPath(); g.arc(px, py, 4, 0, 7); g.fillStyle = colour; g.fill();
    g.strokeStyle = css('--card'); g.lineWidth = 2; g.stroke();
    if (!words) return;
    const { quantity } = this, text = `${hour_minute(point.at)} · ${quantity.words(quantity.value(point.value))} ${quantity.unit()}`;
    const wide = g.measureText(text).width + 12, left = Math.min(px + 8, this.area.left + this.area.width - wide);
    g.fillStyle = css('--card'); g.strokeStyle = css('--line'); g.lineWidth = 1;
    g.beginPath(); g.rect(Math.round(left) + 0.5, this.area.top + 0.5, Math.round(wide), Math.round(size * 1.7)); g.fill(); g.stroke();
    g.fillStyle = css('--ink'); g.textAlign = 'left'; g.textBaseline = 'middle';
    g.fillText(text, left + 6, this.area.top + size * 0.9);
  }
}
