// A shape that is set on the map corner by corner, by clicks or under the cross-hair, until it is told.

const L = window.L;
const LEAST = { ground: 3, way: 2 };
const NEEDS = { ground: "An outline needs three corners", way: "A way needs two corners" };

/** @typedef {keyof typeof LEAST} Outline */

export class Sketch {
  /** @type {any[]} */
  corners = [];
  /** @type {Outline} */
  kind = "ground";

  /** @param {any} map */
  constructor(map) {
    const style = { className: "tape", weight: 3, dashArray: "6 6", interactive: false };
    this.map = map;
    this.drawn = {
      ground: L.polygon([], { ...style, fill: false }),
      way: L.polyline([], style),
    };
  }

  /** @param {any[]} corners */
  set(corners) {
    this.corners = corners;
    for (const [kind, line] of Object.entries(this.drawn)) {
      const shown = kind === this.kind && corners.length;
      line.setLatLngs(shown ? corners : []);
      if (shown) line.addTo(this.map);
      else line.remove();
    }
  }

  /** Draw the corners as the outline of ground, or as a way.
   * @param {Outline} kind */
  as(kind) {
    this.kind = kind;
    this.set(this.corners);
  }

  /** What is set, in words. */
  words() {
    const count = this.corners.length;
    return count === 1 ? "1 corner" : `${count || "no"} corners`;
  }

  /** As GeoJSON, longitude first; throws an Error with what is missing. */
  geometry() {
    if (this.corners.length < LEAST[this.kind]) {
      throw new Error(`${NEEDS[this.kind]}, and there are ${this.corners.length}: click the map`);
    }
    const way = this.corners.map(({ lat, lng }) => [lng, lat]);
    return this.kind === "way"
      ? { type: "LineString", coordinates: way }
      : { type: "Polygon", coordinates: [[...way, way[0]]] };
  }
}
