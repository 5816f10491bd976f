// The tracking page has its texts in page/text/LANGUAGE.js and nowhere else: node check_texts.mjs PAGE_FOLDER
// Needs no browser. Exits 0 only if every check held.
import { readdirSync, readFileSync } from 'node:fs';
import { join, resolve } from 'node:path';

const folder = process.argv[2] && resolve(process.argv[2]);
if (!folder) {
  console.error('usage: node check_texts.mjs PAGE_FOLDER');
  process.exit(2);
}
const problems = [];
const languages = {};
const module_of = async file => (await import(`data:text/javascript,${encodeURIComponent(readFileSync(file, 'utf8'))}`)).default;
for (const file of readdirSync(join(folder, 'text')))
  languages[file.replace('.js', '')] = await module_of(join(folder, 'text', file));
const english = languages.en;
const slots = text => [...text.matchAll(/\{(\w+)\}/g)].map(m => m[1]).sort().join();

for (const [language, texts] of Object.entries(languages)) {
  for (const key of Object.keys(english)) {
    if (!(key in texts)) problems.push(`text/${language}.js lacks ${key}`);
    else if (slots(texts[key]) !== slots(english[key])) problems.push(`text/${language}.js: ${key} has the values {${slots(texts[key])}}, in English {${slots(english[key])}}`);
  }
  for (const key of Object.keys(texts)) if (!(key in english)) problems.push(`text/${language}.js: ${key} is not in text/en.js`);
}

// index.html: what it says as it comes is the English text of a key. Names, symbols and numbers need none.
const symbols = /^(?:[\s\d:×–—°·.,…%]*|A-Tirma( · live tracking)?|kn|m\/s|(?:\d+|15) (?:h|min)|XBee|GPRS|Iridium|GPX|KML|CSV|GeoJSON|English|Español|--:--:--|EN|ES)$/;
const html = readFileSync(join(folder, 'index.html'), 'utf8').replace(/<!--[^]*?-->/g, '');
const used = new Set();
const entities = text => text.replaceAll('&amp;', '&').replaceAll('&lt;', '<').replaceAll('&gt;', '>');
for (const [tag, , attributes, text] of html.matchAll(/<(\w+)((?:\s[^<>]*)?)>([^<]*)/g)) {
  const key = attributes.match(/data-text="(\w+)"/)?.[1], said = entities(text.trim());
  if (key) {
    used.add(key);
    if (said !== english[key]) problems.push(`index.html: "${said}" is not the text of ${key}: "${english[key]}"`);
  } else if (!symbols.test(said)) problems.push(`index.html: "${said}" stands there without data-text`);
  for (const [attribute, data] of [['aria-label', 'data-label'], ['title', 'data-title'], ['placeholder', null], ['alt', null]]) {
    const value = attributes.match(new RegExp(`\\s${attribute}="([^"]*)"`))?.[1], of = data && attributes.match(new RegExp(`${data}="(\\w+)"`))?.[1];
    if (of) {
      used.add(of);
      if (value !== english[of]) problems.push(`index.html: ${attribute}="${value}" is not the text of ${of}`);
    } else if (value && !/id="(left|right)-quantity"/.test(attributes)) problems.push(`index.html: ${attribute}="${value}" stands there without ${data ?? 'a text'} (<${tag.slice(1, 20)})`);
  }
}

// The modules: t('key') and what is put together; no literal that reads like words.
const modules = readdirSync(folder).filter(f => f.endsWith('.js') && f !== 'places.js');
for (const file of modules) {
  const code = readFileSync(join(folder, file), 'utf8').replace(/\/\*[^]*?\*\//g, '').replace(/(^|[^:'"`\w])\/\/.*$/gm, '$1');
  for (const [, literal] of code.matchAll(/'((?:[^'\\\n]|\\.)*)'/g)) if (literal in english) used.add(literal);
  for (const [, key] of code.matchAll(/\bt\('(\w+)'/g)) if (!(key in english)) problems.push(`${file}: t('${key}') is no text`);
  for (const [, prefix] of code.matchAll(/t\(`(\w+?_)\$\{/g)) for (const key of Object.keys(english)) if (key.startsWith(prefix)) used.add(key);
  const literals = [...code.matchAll(/'((?:[^'\\\n]|\\.)*)'/g)].map(m => m[1]).concat([...code.matchAll(/`((?:[^`\\]|\\.)*)`/g)].map(m => m[1].replace(/\$\{(?:[^{}]|\{[^{}]*\})*\}/g, '\u0001')));
  for (const literal of literals) {
    const plain = literal.replace(/<[^>]*>/g, '').replace(/^(M|L)?[\d .,MLCAZ-]+$/, '');
    // Words as people read them: two of letters side by side, or one that begins with a capital.
    if (/\p{L}{2,} \p{L}{2,}/u.test(plain) && !/^[a-z0-9 \u0001_-]+$/.test(plain) || /^\p{Lu}\p{Ll}{2,}$/u.test(plain) && !/^(Arrow\w+|Enter|Escape|End|Home|Leaflet)$/.test(plain))
      problems.push(`${file}: "${literal.replaceAll('\u0001', '…')}" reads like a text: put it into text/en.js`);
  }
}
const style = readFileSync(join(folder, 'style.css'), 'utf8');
for (const [, declared] of style.matchAll(/content:([^;}]*)/g)) for (const [, said] of declared.matchAll(/"([^"]*)"/g)) if (/\p{L}/u.test(said)) problems.push(`style.css: content "${said}" is a text`);
const places = await module_of(join(folder, 'places.js')); // names of places are the same in every language, or keys
for (const [name] of places) if (name in english) used.add(name);
for (const key of Object.keys(english)) if (!used.has(key)) problems.push(`text/en.js: ${key} is not used`);

for (const problem of problems) console.error(problem);
console.log(problems.length ? `${problems.length} problems` : `${Object.keys(english).length} texts in ${Object.keys(languages).length} languages, none in the code`);
process.exit(problems.length ? 1 : 0);
