// The links of the boat, each with when it was heard last; and the other boats of this server.
import { embed } from './place.js';
import { t } from './text.js';
import { duration, link_name, moment } from './units.js';

const order = ['xbee', 'gprs', 'iridium'];

const row = (list, key, make) => {
  let node = list.querySelector(`[data-key="${CSS.escape(key)}"]`);
  if (!node) { node = make(); node.dataset.key = key; list.append(node); }
  return node;
};
const put = (node, selector, text) => { const part = node.querySelector(selector); if (part.textContent !== text) part.textContent = text; };

/// What is known of each link: [{source, state: 'good' | 'quiet' | 'off' | 'unknown', age, note}]. `lost`: this page lost the server.
export function link_states(store, now, lost) {
  const { state } = store;
  const feeds = state.feeds ?? [], heard = state.heard ?? {};
  const nodes = feeds.find(f => !f.link);
  const names = [...new Set([...feeds.filter(f => f.link).map(f => f.source), ...Object.keys(heard)])];
  names.sort((a, b) => (order.indexOf(a) + 9) % 9 - (order.indexOf(b) + 9) % 9 || a.localeCompare(b));
  return names.map(source => {
    const feed = feeds.find(f => f.source === source && f.link), at = heard[source];
    const age = at ? now - at : null;
    if (lost) return { source, age, state: 'unknown', note: '' };
    if (nodes && !nodes.connected) return { source, age, state: 'unknown', note: t('state_unknown_shore') };
    if (feed && !feed.connected) return { source, age, state: 'off', note: t('receiver_off_since', { moment: moment(feed.since, now) }) };
    if (age === null) return { source, age, state: 'quiet', note: t('not_heard') };
    const quiet = age >= store.limits('position', source).stale;
    return { source, age, state: quiet ? 'quiet' : 'good', note: quiet ? t('silent_listens') : '' };
  });
}

const words = { good: 'heard', quiet: 'silent', off: 'receiver_off', unknown: 'unknown' }; // keys of the texts

/// The nodes' own words are English: those that are known are translated.
function shore_words(detail) {
  const [, node, , other] = detail.match(/^(\S+?), (backed by (\S+)|without the other one)$/) ?? [];
  return !node ? detail : other ? t('shore_backed', { node, other }) : t('shore_alone', { node });
}

export function show_links(list, store, now, lost) {
  const all = link_states(store, now, lost);
  for (const link of all) {
    const item = row(list, link.source, () => {
      const made = document.createElement('li');
      made.innerHTML = '<i aria-hidden="true"></i><b></b><span class="age-of"></span><small></small>';
      return made;
    });
    item.dataset.state = link.state;
    put(item, 'b', link_name(link.source));
    put(item, '.age-of', link.age === null ? t(words[link.state]) : t('ago', { time: duration(link.age) }));
    put(item, 'small', link.note);
  }
  for (const item of [...list.children]) if (!all.some(link => link.source === item.dataset.key)) item.remove();
  const nodes = (store.state.feeds ?? []).find(f => !f.link);
  if (lost) return t('links_unknown');
  return nodes ? nodes.connected ? t('shore', { detail: shore_words(nodes.detail) }) : t('shore_lost', { moment: moment(nodes.since, now) }) : '';
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
    const at = boat.position?.measured_at, old = lost || !at || now - at >= boat.stale_after_s * 1000;
    item.classList.toggle('old', old);
    put(item, 'b', boat.id === own ? t('shown_boat', { name: boat.name }) : boat.name);
    put(item, 'span', at ? t('ago', { time: duration(now - at) }) : t('no_position_short'));
  }
}
