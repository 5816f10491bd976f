// A small time chart on a canvas: one quantity as an area, a cursor, and wind arrows if asked for.
import { hour_minute, known, speed, speed_unit, speed_value } from './units.js';

const steps_s = [10, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400, 172800, 604800];
const gap_ms = 180000;

function nice_top(value) {
  for (const top of [1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100, 200]) if (value <= top) return top;
  return value;
}

export class Chart {
  constructor(canvas, { column, direction, colour, on_pick }) {
    Object.assign(this, { canvas, column, direction, colour, track: [], cursor: null, window: null });
    new ResizeObserver(() => this.draw()).observe(canvas);
    const pick = event => {
      if (!this.range) return;
      const box = canvas.getBoundingClientRect();
      on_pick(this.time_at(event.clientX - box.left));
    };
    canvas.addEventListener('pointerdown', event => { canvas.setPointerCapture(event.pointerId); pick(event); });
    canvas.addEventListener('pointermove', event => { if (event.buttons) pick(event); });
  }

  /// `window`: [from, to] in milliseconds; the cursor is a time or null.
  show(track, cursor, window) { Object.assign(this, { track, cursor, window }); this.draw(); }

  time_at(x) {
    const { left, width } = this.area, [from, to] = this.range;
    return from + (to - from) * Math.min(1, Math.max(0, (x - left) / width));
  }

  draw() {
    const { canvas, column } = this;
    const track = this.window ? this.track.filter(p => p.at >= this.window[0] && p.at <= this.window[1]) : this.track;
    const w = canvas.clientWidth, h = canvas.clientHeight, ratio = devicePixelRatio || 1;
    if (!w || !h) return;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    const g = canvas.getContext('2d');
    const style = getComputedStyle(canvas), css = name => style.getPropertyValue(name).trim();
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, w, h);
    g.font = `11px ${style.fontFamily}`;
    const area = this.area = { left: 26, top: this.direction ? 20 : 8, width: w - 34, height: h - (this.direction ? 38 : 26) };
    const values = track.map(p => p[column]).filter(known);
    if (track.length < 2 || !values.length) {
      g.fillStyle = css('--ink-3');
      g.textAlign = 'center';
      g.fillText('Nothing to draw yet', w / 2, h / 2);
      this.range = null;
      canvas.setAttribute('aria-label', `${canvas.dataset.name}: nothing to draw yet.`);
      return;
    }
    const from = Number.isFinite(this.window?.[0]) ? this.window[0] : track[0].at, to = Math.max(track.at(-1).at, from + 1000);
    this.range = [from, to];
    const top = nice_top(speed_value(Math.max(...values, 0.4)) * 1.05);
    const x = at => area.left + area.width * (at - from) / (to - from);
    const y = mps => area.top + area.height * (1 - speed_value(mps) / top);

    g.lineWidth = 1;
    g.textAlign = 'right';
    g.textBaseline = 'middle';
    for (const part of [0, 0.5, 1]) {
      const at = Math.round(area.top + area.height * (1 - part)) + 0.5;
      g.strokeStyle = css('--grid');
      g.beginPath(); g.moveTo(area.left, at); g.lineTo(area.left + area.width, at); g.stroke();
      g.fillStyle = css('--ink-3');
      g.fillText(String(+(top * part).toFixed(1)), area.left - 6, at);
    }
    g.textAlign = 'center';
    g.textBaseline = 'alphabetic';
    const step = 1000 * (steps_s.find(s => (to - from) / 1000 / s <= Math.max(2, w / 90)) ?? 604800);
    for (let at = Math.ceil(from / step) * step; at <= to; at += step) {
      const px = x(at);
      if (px < area.left + 10 || px > w - 16) continue;
      g.fillText(step < 60000 ? new Date(at).toISOString().slice(14, 19) : hour_minute(at), px, h - 5);
    }

    const colour = css(this.colour); // #rrggbb: an alpha is put behind it
    const fade = g.createLinearGradient(0, area.top, 0, area.top + area.height);
    fade.addColorStop(0, `${colour}60`);
    fade.addColorStop(1, `${colour}08`);
    // At most some points a pixel are drawn; a silence is a gap, not a slope.
    const runs = [];
    let run = null, previous = null;
    for (const point of track) {
      if (!known(point[column])) continue;
      if (!run || point.at - previous.at > Math.max(gap_ms, (to - from) / 60)) runs.push(run = []);
      const px = x(point.at), py = y(point[column]), last = run.at(-1);
      if (last && px - last[0] < 0.7) last[1] = (last[1] * last[2] + py) / ++last[2]; else run.push([px, py, 1]);
      previous = point;
    }
    for (const points of runs) {
      g.beginPath();
      points.forEach(([px, py], i) => i ? g.lineTo(px, py) : g.moveTo(px, py));
      g.strokeStyle = colour; g.lineWidth = 1.6; g.lineJoin = 'round';
      g.stroke();
      g.lineTo(points.at(-1)[0], area.top + area.height);
      g.lineTo(points[0][0], area.top + area.height);
      g.fillStyle = fade;
      g.fill();
    }
    if (this.direction) this.#arrows(g, track, x, css);
    if (this.cursor !== null) this.#cursor(g, x, y, css, colour);
    canvas.setAttribute('aria-label', `${canvas.dataset.name}: between ${speed(Math.min(...values))} and ${speed(Math.max(...values))} ${speed_unit()}, ` +
      `from ${hour_minute(from)} to ${hour_minute(to)}, last ${speed(values.at(-1))}.`);
  }

  #arrows(g, track, x, css) {
    g.strokeStyle = g.fillStyle = css('--ink-2');
    g.lineWidth = 1.3;
    let next = this.area.left + 12;
    for (const point of track) {
      const px = x(point.at);
      if (px < next || !known(point[this.direction])) continue;
      next = px + 34;
      g.save();
      g.translate(px, 9);
      g.rotate(point[this.direction] * Math.PI / 180); // drawn as blowing from up to down
      g.beginPath(); g.moveTo(0, -7); g.lineTo(0, 4); g.stroke();
      g.beginPath(); g.moveTo(0, 7); g.lineTo(-3.2, 1); g.lineTo(3.2, 1); g.fill();
      g.restore();
    }
  }

  #cursor(g, x, y, css, colour) {
    const point = this.track.findLast(p => p.at <= this.cursor && known(p[this.column]));
    const px = Math.round(x(this.cursor)) + 0.5;
    g.strokeStyle = css('--ink-2'); g.lineWidth = 1;
    g.beginPath(); g.moveTo(px, this.area.top); g.lineTo(px, this.area.top + this.area.height); g.stroke();
    if (!point) return;
    const py = y(point[this.column]);
    g.beginPath(); g.arc(px, py, 4, 0, 7); g.fillStyle = colour; g.fill();
    g.strokeStyle = css('--card'); g.lineWidth = 2; g.stroke();
  }
}
