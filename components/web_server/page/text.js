// The page's texts in the language of its reader.
import en from './text/en.js';
import es from './text/es.js';

const tables = { en, es };
export const languages = Object.keys(tables);
let table = en;

export const of_browser = () => (navigator.languages ?? []).map(l => l.slice(0, 2).toLowerCase()).find(l => l in tables) ?? 'en';
export const speak = language => { table = tables[language] ?? en; };
export const has = key => key in table;
export const t = (key, values = {}) => table[key].replace(/\{(\w+)\}/g, (_, name) => values[name] ?? '');

/// What index.html says, which is English as it comes.
export function translate(root) {
  for (const node of root.querySelectorAll('[data-text]')) node.textContent = t(node.dataset.text);
  for (const node of root.querySelectorAll('[data-label]')) node.setAttribute('aria-label', t(node.dataset.label));
  for (const node of root.querySelectorAll('[data-title]')) node.title = t(node.dataset.title);
}
