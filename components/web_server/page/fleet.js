// Where the other boats were at a time that has passed: their tracks are asked for when somebody looks back.
import { unpack } from './store.js';
import { url } from './place.js';

const max_tracks = 60; // of a larger fleet the others are not on the map while it plays

export class FleetPast {
  #tracks = new Map(); // by boat: null while it is asked for, else [{measured_at, latitude_deg, longitude_deg}]
  #changed;

  constructor(changed) { this.#changed = changed; }

  /// The boats with their positions then; null where there is none, or not yet.
  at(boats, own, time) {
    return boats.map(boat => ({ ...boat, position: boat.id === own ? boat.position : this.#position(boat.id, time) }));
  }

  /// The present is shown again: the next time the tracks are longer.
  forget() { this.#tracks.clear(); }

  #position(id, time) {
    const track = this.#tracks.get(id);
    if (track === undefined && this.#tracks.size < max_tracks) this.#ask(id);
    if (!track) return null;
    let low = 0, high = track.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (track[middle].measured_at <= time) low = middle + 1; else high = middle;
    }
    return track[low - 1] ?? null;
  }

  async #ask(id) {
    const tracks = this.#tracks;
    tracks.set(id, null);
    try {
      const answer = await fetch(url('track.json', id));
      if (!answer.ok) throw new Error(`${answer.status}`);
      const { columns } = await answer.json();
      const [at, latitude, longitude] = ['at', 'latitude_deg', 'longitude_deg'].map(name => unpack(columns[name]));
      if (tracks.has(id)) tracks.set(id, at.map((measured_at, i) => ({ measured_at, latitude_deg: latitude[i], longitude_deg: longitude[i] })));
      this.#changed();
    } catch {
      setTimeout(() => tracks.delete(id), 5000); // then it is asked again
    }
  }
}
