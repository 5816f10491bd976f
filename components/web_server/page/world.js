// The coast by level: the whole world in two, and around the boat's home in detail; each is loaded when it is looked at.
import * as L from 'leaflet/leaflet.esm.min.js';
import places from './places.js';
import { has, t } from './text.js';

const middle_zoom = 4.75; // from here on the finer world
const detail_zoom = 8;    // from here on the detailed coast
const frame_zoom = 9;     // from here on the world's coast looks coarse, and the edge of the detailed one is drawn

export class Coast {
  #map; #detail = null; #detail_layers = L.layerGroup(); #frame = null; #worlds = new Map(); #shown = new Map(); #labels = [];
  #on_coarse; #settled = false;

  /// `on_coarse` is told which text describes a coast that is rougher than it looks at this zoom; null: none.
  constructor(map, on_coarse) {
    this.#map = map;
    this.#on_coarse = on_coarse;
    map.createPane('world').style.zIndex = 290;
    map.createPane('coast').style.zIndex = 300;
    this.#detail_layers.addTo(map);
    for (const [name, lat, lon, least, end, kind] of places) {
      const icon = L.divIcon({ className: `place ${kind}`, html: '<span></span>', iconSize: [0, 0] });
      this.#labels.push({ name, least, end, marker: L.marker([lat, lon], { pane: 'coast', interactive: false, keyboard: false, icon }) });
    }
    map.on('moveend', () => this.look());
    map.on('load', () => this.look());
  }

  /// After the language was changed.
  rename() { for (const { name, marker } of this.#labels) { const span = marker.getElement()?.querySelector('span'); if (span) span.textContent = has(name) ? t(name) : name; } }

  /// From now on the view is worth loading a coast for: before, it may be a place that is left at once.
  settle() { if (!this.#settled) { this.#settled = true; this.look(); } }

  look() {
    if (!this.#settled) return;
    const zoom = this.#map.getZoom(), view = this.#map.getBounds();
    for (const { least, end, marker } of this.#labels) if (zoom >= least && zoom < end) marker.addTo(this.#map); else marker.remove();
    this.rename();
    const detailed = zoom >= detail_zoom;
    if (detailed && this.#detail === null) this.#load_detail();
    if (this.#detail?.layers) for (const layer of this.#detail.layers) if (detailed) this.#detail_layers.addLayer(layer); else this.#detail_layers.removeLayer(layer);
    const box = this.#detail?.bounds;
    const inside = detailed && (box ? box.contains(view) : this.#detail === 'loading');
    const level = zoom < middle_zoom ? '110m' : '50m';
    if (!inside) this.#show_world(level, view.pad(0.3), detailed ? box : null);
    else this.#show_world(null);
    const framed = !inside && zoom >= frame_zoom && !!box && box.intersects(view);
    if (this.#frame) if (framed) this.#frame.addTo(this.#map); else this.#frame.remove();
    this.#on_coarse(framed ? 'coarse_coast' : !inside && zoom >= frame_zoom && box ? 'coarse_everywhere' : null);
  }

  async #load_detail() {
    this.#detail = 'loading';
    let coast;
    try { coast = await (await fetch('coast.json')).json(); } catch { this.#detail = null; return; } // tried again at the next move
    const layers = [3, 2, 1, 0].map(ring => // the lines along the shore of old charts: wide and faint first
      L.geoJSON(coast, { pane: 'coast', interactive: false, style: () => ({ className: ring ? `shore shore-${ring}` : 'land' }) }));
    const bounds = layers[3].getBounds().pad(0.12);
    this.#detail = { layers, bounds };
    this.#frame = L.rectangle(bounds, { className: 'edge', interactive: false, pane: 'coast' });
    this.#map.attributionControl.addAttribution(coast.attribution);
    this.look();
  }

  #show_world(level, view, but) {
    for (const [shore, layer] of this.#shown)
      if (shore.level !== level || !shore.bounds.intersects(view) || but?.contains(shore.bounds)) { layer.remove(); this.#shown.delete(shore); }
    if (!level) return;
    const world = this.#worlds.get(level);
    if (!world) { this.#load_world(level); return; }
    for (const shore of world)
      if (!this.#shown.has(shore) && shore.bounds.intersects(view) && !but?.contains(shore.bounds))
        this.#shown.set(shore, L.polygon(shore.rings, { pane: 'world', className: 'land world', interactive: false }).addTo(this.#map));
  }

  async #load_world(level) {
    this.#worlds.set(level, []);
    let world;
    try { world = await (await fetch(`world-${level}.json`)).json(); } catch { this.#worlds.delete(level); return; }
    const ring_of = steps => {
      const ring = [];
      for (let i = 0, lat = 0, lon = 0; i < steps.length; i += 2) ring.push([(lat += steps[i]) / world.scale, (lon += steps[i + 1]) / world.scale]);
      return ring;
    };
    this.#worlds.set(level, world.polygons.map(polygon => { const rings = polygon.map(ring_of); return { level, rings, bounds: L.latLngBounds(rings[0]) }; }));
    this.#map.attributionControl.addAttribution(world.attribution);
    this.look();
  }
}
