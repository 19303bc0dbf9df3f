// Several aircraft on the map, each in its own colour with its name: where it is, what it flew, where it goes.

import { COLOURS } from "./fleet.js";
import { CRAFT, icon } from "./marks.js";

const L = window.L;

/** Draw what was flown. A track grows or is cut, so one that is as long as it was is the same.
 * @param {any[]} lines
 * @param {Place[]} track */
export function drawTrack(lines, track) {
  for (const line of lines) {
    if (line.getLatLngs().length !== track.length) line.setLatLngs(track);
  }
}

/** One aircraft's marks. */
class Flyer {
  /** @param {Flock} flock
   * @param {AircraftState} craft */
  constructor(flock, { name, colour }) {
    const own = `own-${colour % COLOURS}`,
      line = { pane: "flight", interactive: false };
    this.flock = flock;
    this.casing = L.polyline([], { ...line, className: "casing", weight: 5, opacity: 0.8 });
    this.track = L.polyline([], { ...line, className: `own-line ${own}`, weight: 2.5 });
    this.ahead = L.polyline([], {
      ...line,
      className: `own-line ${own}`,
      weight: 3.5,
      opacity: 0.85,
      lineCap: "round",
      dashArray: "1 9",
    });
    this.mark = L.marker([0, 0], {
      icon: icon(CRAFT, 36, `craft flyer ${own}`),
      interactive: false,
      keyboard: false,
      alt: `aircraft ${name}`,
      zIndexOffset: 1000,
    });
    const label = document.createElement("span");
    label.textContent = name; // as text, and never as HTML
    const made = L.divIcon({ className: `roi flyer-name ${own}`, html: label });
    this.name = L.marker([0, 0], { icon: made, interactive: false, keyboard: false });
    flock.tracks.addLayer(this.casing).addLayer(this.track);
    flock.plans.addLayer(this.ahead);
  }

  /** @param {AircraftState} craft
   * @param {Place[]} track */
  draw({ lat, lon, heading_deg, ahead }, track) {
    drawTrack([this.casing, this.track], track);
    this.ahead.setLatLngs(ahead);
    if (lat === null || lon === null) {
      this.mark.remove();
      this.name.remove();
      return;
    }
    const place = [lat, lon];
    this.mark.setLatLng(place).addTo(this.flock.map);
    this.name.setLatLng(place).addTo(this.flock.map);
    const turned = this.mark.getElement().querySelector("g");
    turned.setAttribute("transform", `rotate(${heading_deg ?? 0})`);
  }

  remove() {
    for (const layer of [this.casing, this.track]) this.flock.tracks.removeLayer(layer);
    this.flock.plans.removeLayer(this.ahead);
    this.mark.remove();
    this.name.remove();
  }
}

/** All of them. */
export class Flock {
  /** By name. @type {Map<string, Flyer>} */
  flyers = new Map();

  /** `tracks` and `plans`: the layers that show what was flown and the way ahead.
   * @param {any} map
   * @param {any} tracks
   * @param {any} plans */
  constructor(map, tracks, plans) {
    this.map = map;
    this.tracks = tracks;
    this.plans = plans;
  }

  /** @param {AircraftState[]} fleet none: there is only one aircraft, which is drawn elsewhere
   * @param {Place[][]} tracks of each, as far as there is one */
  draw(fleet, tracks) {
    const names = fleet.map(({ name }) => name);
    for (const [name, flyer] of this.flyers) {
      if (names.includes(name)) continue;
      flyer.remove();
      this.flyers.delete(name);
    }
    fleet.forEach((craft, number) => {
      let flyer = this.flyers.get(craft.name);
      if (!flyer) this.flyers.set(craft.name, (flyer = new Flyer(this, craft)));
      flyer.draw(craft, tracks[number] ?? []);
    });
  }
}
