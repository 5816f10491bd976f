// The wind dial: the boat points up, the compass ring turns around it.
import { t } from './text.js';
import { known, degrees } from './units.js';

const svg = (name, attributes = {}, ...children) => {
  const node = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
};
const polar = (angle, radius) => [Math.sin(angle * Math.PI / 180) * radius, -Math.cos(angle * Math.PI / 180) * radius].map(n => n.toFixed(2));

export class Dial {
  #ring; #true; #apparent; #no_go; #north; #root;
  #letters = new Map();
  #turned = new Map(); // the angle each part was turned to, so that it takes the short way

  constructor(place) {
    const ring = svg('g', { class: 'ring' });
    for (let a = 0; a < 360; a += 10) {
      const [x1, y1] = polar(a, 92), [x2, y2] = polar(a, a % 30 ? 88 : 84);
      ring.append(svg('line', { x1, y1, x2, y2, class: a % 30 ? 'tick' : 'tick major' }));
    }
    for (const [a, name] of [[0, 'north'], [90, 'east'], [180, 'south'], [270, 'west']]) {
      const letter = svg('text', { class: a ? 'letter' : 'letter north', transform: `rotate(${a}) translate(0 -69)`, 'text-anchor': 'middle', dy: 5 });
      this.#letters.set(name, letter);
      ring.append(letter);
    }
    const [nx, ny] = polar(-42, 92), [px, py] = polar(42, 92);
    this.#no_go = svg('path', { class: 'no-go', d: `M0 0L${nx} ${ny}A92 92 0 0 1 ${px} ${py}Z` });
    // The true wind stands outside the rim, the apparent wind inside: they never cover each other.
    const arrow = (kind, letter, y, ...shapes) => {
      const label = svg('text', { 'text-anchor': 'middle', y, dy: 3.9, class: 'arrow-letter' });
      label.textContent = letter;
      return svg('g', { class: `arrow ${kind}` }, ...shapes, svg('circle', { cx: 0, cy: y, r: 9.5 }), label);
    };
    this.#true = arrow('true', 'T', -105, svg('path', { d: 'M0 -80 L-10 -98 L10 -98 Z' }));
    this.#apparent = arrow('apparent', 'A', -76, svg('path', { d: 'M0 -40 L-8.5 -57 L0 -53 L8.5 -57 Z' }), svg('line', { x1: 0, y1: -54, x2: 0, y2: -70 }));
    this.#ring = ring;
    this.#root = svg('svg', { viewBox: '-116 -116 232 232', class: 'dial', role: 'img' },
      svg('circle', { r: 92, class: 'face' }), this.#no_go, ring,
      svg('path', { class: 'hull', d: 'M0 -36 C12 -18 14 4 9 32 L-9 32 C-14 4 -12 -18 0 -36Z' }),
      svg('line', { class: 'deck', x1: 0, y1: -24, x2: 0, y2: 28 }),
      svg('path', { class: 'up', d: 'M-5 -102 L5 -102 L0 -93 Z' }),
      this.#apparent, this.#true);
    place.append(this.#root);
  }

  #turn(node, angle) {
    const before = this.#turned.get(node) ?? 0;
    const to = before + ((angle - before) % 360 + 540) % 360 - 180;
    this.#turned.set(node, to);
    node.style.transform = `rotate(${to}deg)`;
  }

  /// `heading` also stands for the course where no heading is known.
  show({ heading, apparent_angle, true_direction }) {
    const up = known(heading) ? heading : 0;
    this.#turn(this.#ring, -up);
    const has_true = known(true_direction), has_apparent = known(apparent_angle);
    this.#true.classList.toggle('absent', !has_true);
    this.#no_go.classList.toggle('absent', !has_true);
    this.#apparent.classList.toggle('absent', !has_apparent);
    if (has_true) { this.#turn(this.#true, true_direction - up); this.#turn(this.#no_go, true_direction - up); }
    if (has_apparent) this.#turn(this.#apparent, apparent_angle);
    for (const [name, letter] of this.#letters) letter.textContent = t(name);
    this.#root.setAttribute('aria-label', [t('wind_dial'), has_true ? t('wind_dial_true', { degrees: degrees(true_direction) }) : '',
      has_apparent ? t('wind_dial_apparent', { degrees: Math.abs(Math.round(apparent_angle)), side: t(apparent_angle < 0 ? 'port' : 'starboard') }) : ''].join(' ').trim());
  }
}
