// The links of the boat, each with when it was heard last; and the other boats of this server.
import { embed } from './place.js';
import { duration, link_name, moment } from './units.js';

const order = ['xbee', 'gprs', 'iridium'];
const patience_s = { xbee: 60, gprs: 120, iridium: 3700 }; // silent for longer than that is worth a look

const row = (list, key, make) => {
  let node = list.querySelector(`[data-key="${CSS.escape(key)}"]`);
  if (!node) { node = make(); node.dataset.key = key; list.append(node); }
  return node;
};
const put = (node, selector, text) => { const part = node.querySelector(selector); if (part.textContent !== text) part.textContent = text; };

/// What is known of each link: [{source, state: 'good' | 'quiet' | 'off' | 'unknown', age, note}]. `lost`: this page lost the server.
export function link_states(state, now, lost) {
  const feeds = state.feeds ?? [], heard = state.heard ?? {};
  const nodes = feeds.find(f => !f.link);
  const names = [...new Set([...feeds.filter(f => f.link).map(f => f.source), ...Object.keys(heard)])];
  names.sort((a, b) => (order.indexOf(a) + 9) % 9 - (order.indexOf(b) + 9) % 9 || a.localeCompare(b));
  return names.map(source => {
    const feed = feeds.find(f => f.source === source && f.link), at = heard[source];
    const age = at ? now - at : null;
    if (lost) return { source, age, state: 'unknown', note: '' };
    if (nodes && !nodes.connected) return { source, age, state: 'unknown', note: 'state unknown: no connection to the shore station' };
    if (feed && !feed.connected) return { source, age, state: 'off', note: `receiver off since ${moment(feed.since, now)}` };
    if (age === null) return { source, age, state: 'quiet', note: 'not heard so far' };
    const quiet = age > 1000 * (patience_s[source] ?? 120);
    return { source, age, state: quiet ? 'quiet' : 'good', note: quiet ? 'silent, its receiver listens' : '' };
  });
}

const words = { good: 'heard', quiet: 'silent', off: 'receiver off', unknown: 'unknown' };

export function show_links(list, state, now, lost) {
  const all = link_states(state, now, lost);
  for (const link of all) {
    const item = row(list, link.source, () => {
      const made = document.createElement('li');
      made.innerHTML = '<i aria-hidden="true"></i><b></b><span class="age-of"></span><small></small>';
      return made;
    });
    item.dataset.state = link.state;
    put(item, 'b', link_name(link.source));
    put(item, '.age-of', link.age === null ? words[link.state] : `${duration(link.age)} ago`);
    put(item, 'small', link.note);
  }
  for (const item of [...list.children]) if (!all.some(link => link.source === item.dataset.key)) item.remove();
  const nodes = (state.feeds ?? []).find(f => !f.link);
  if (lost) return 'How they are now is not known: this page lost the server';
  return nodes ? nodes.connected ? `Shore station: ${nodes.detail}` : `No connection to the shore station since ${moment(nodes.since, now)}` : '';
}

export function show_fleet(list, boats, own, now, lost) {
  for (const boat of boats) {
    const item = row(list, boat.id, () => {
      const made = document.createElement('li');
      made.innerHTML = '<a><b></b><span></span></a>';
      const link = made.firstElementChild;
      link.href = embed ? `embed?boat=${encodeURIComponent(boat.id)}` : encodeURIComponent(boat.id);
      if (boat.id === own) link.setAttribute('aria-current', 'page');
      return made;
    });
    const at = boat.position?.measured_at, old = lost || !at || now - at > boat.stale_after_s * 1000;
    item.classList.toggle('old', old);
    put(item, 'b', boat.name);
    put(item, 'span', at ? `${duration(now - at)} ago` : 'no position yet');
  }
}
