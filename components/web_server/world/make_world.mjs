// Makes world-110m.json and world-50m.json from Natural Earth's land (public domain), as the npm package world-atlas
// 2.0.2 has it in TopoJSON: npm pack world-atlas@2.0.2 && tar xf world-atlas-2.0.2.tgz && node make_world.mjs package .
import { readFileSync, statSync, writeFileSync } from 'node:fs';

const [from, to] = process.argv.slice(2);
if (!to) {
  console.error('usage: node make_world.mjs FOLDER_OF_WORLD_ATLAS FOLDER');
  process.exit(2);
}

/// Of each triangle that a point makes with its neighbours, the area decides what goes (Visvalingam), in degrees
/// squared, with longitudes as wide as they are there.
function simplify(ring, least) {
  const points = ring.map(([x, y]) => ({ x, y, gone: false }));
  const n = points.length;
  const shrink = Math.cos(ring.reduce((sum, p) => sum + p[1], 0) / n * Math.PI / 180);
  points.forEach((p, i) => { p.before = (i + n - 1) % n; p.after = (i + 1) % n; });
  const area = p => {
    const a = points[p.before], b = points[p.after];
    return Math.abs((p.x - a.x) * (b.y - a.y) - (b.x - a.x) * (p.y - a.y)) / 2 * shrink;
  };
  let left = n;
  for (let limit = least / 64; limit <= least; limit *= 2) // smallest first, roughly
    for (let again = true; again && left > 4;) {
      again = false;
      for (const p of points) {
        if (p.gone || left <= 4 || area(p) >= limit || Math.abs(p.x) === 180) continue;
        p.gone = again = true;
        --left;
        points[p.before].after = p.after;
        points[p.after].before = p.before;
      }
    }
  return points.filter(p => !p.gone).map(p => [p.x, p.y]);
}

function rings_of(topology) {
  const { scale, translate } = topology.transform;
  const arcs = topology.arcs.map(arc => {
    let x = 0, y = 0;
    return arc.map(([dx, dy]) => [(x += dx) * scale[0] + translate[0], (y += dy) * scale[1] + translate[1]]);
  });
  const line = index => index < 0 ? [...arcs[~index]].reverse() : arcs[index];
  // Across the 180th meridian longitudes go on beyond 180; Antarctica, which goes around the pole, is closed there.
  const unwound = ring => {
    const out = [ring[0]];
    for (const [x, y] of ring.slice(1)) out.push([x - 360 * Math.round((x - out.at(-1)[0]) / 360), y]);
    const around = out[0][0] - out.at(-1)[0];
    return Math.abs(around) > 180 ? [...out, [out.at(-1)[0], -89], [out[0][0], -89]] : out;
  };
  const ring = indices => unwound(indices.flatMap((index, i) => i ? line(index).slice(1) : line(index)).slice(0, -1));
  const shapes = topology.objects.land.geometries ?? [topology.objects.land];
  return shapes.flatMap(shape => shape.type === 'Polygon' ? [shape.arcs] : shape.arcs).map(polygon => polygon.map(ring));
}

for (const [level, least, digits] of [['110m', 0.02, 2], ['50m', 0.0006, 2]]) {
  const topology = JSON.parse(readFileSync(`${from}/land-${level}.json`, 'utf8'));
  const scale = 10 ** digits;
  let count = 0;
  // What reaches beyond the edge of the map stands at its other side, too.
  const middle = ring => { const xs = ring.map(p => p[0]); return (Math.min(...xs) + Math.max(...xs)) / 2; };
  const beside = (ring, x) => { const by = 360 * Math.round((x - middle(ring)) / 360); return ring.map(p => [p[0] + by, p[1]]); };
  const all = rings_of(topology).flatMap(([shore, ...lakes]) => {
    const outer = beside(shore, 0);
    const polygon = [outer, ...lakes.filter(lake => lake.some(p => p[1] > -85)).map(lake => beside(lake, middle(outer)))];
    const xs = outer.map(p => p[0]), low = Math.min(...xs), high = Math.max(...xs);
    const by = high > 180 ? -360 : low < -180 ? 360 : 0;
    return by && high - low < 359 ? [polygon, polygon.map(ring => ring.map(([x, y]) => [x + by, y]))] : [polygon];
  });
  const polygons = all.map(polygon => polygon.map(ring => {
    const kept = simplify(ring, least).map(([x, y]) => [Math.round(y * scale), Math.round(x * scale)]);
    count += kept.length;
    let before = [0, 0];
    return kept.flatMap(([y, x]) => { const step = [y - before[0], x - before[1]]; before = [y, x]; return step; });
  })).filter(polygon => polygon[0].length >= 6);
  const file = `${to}/world-${level}.json`;
  const text = JSON.stringify({ attribution: 'World coast: Natural Earth', scale, polygons });
  writeFileSync(file, `${text.replaceAll(']],[[', ']],\n[[')}\n`);
  console.log(`${file}: ${polygons.length} shores, ${count} points, ${Math.round(statSync(file).size / 1000)} kB`);
}
