// The map: ground, area, belief, POD, regions, flight. Works without internet.

import { Cells, heatColours, percent, podColours, topOf } from "./cells.js";
import { ask } from "./link.js";

const L = window.L;
const MOST_FINE_CELLS = 60000; // beyond, a cell is one pixel of the POD layer
const INK = "#0d1620", BLUE = "#0b4aa2", RED = "#b00020", ORANGE = "#d95f02";

const CRAFT = `<svg width="36" height="36" viewBox="-18 -18 36 36" aria-hidden="true"><g><path d="M0-15 11 12 0 6-11 12Z" fill="#0b4aa2" stroke="#fff" stroke-width="2.5" stroke-linejoin="round"/></g></svg>`;
const LAUNCH = `<svg width="26" height="26" viewBox="-13 -13 26 26" aria-hidden="true"><circle r="11" fill="#fff" stroke="#0d1620" stroke-width="2.5"/><path d="M-4-6V6M4-6V6M-4 0H4" stroke="#0d1620" stroke-width="2.6"/></svg>`;
const FOUND = `<svg width="44" height="44" viewBox="-22 -22 44 44" aria-hidden="true"><path d="M0-18 5-6 18-5 8 3 11 16 0 9-11 16-8 3-18-5-5-6Z" fill="#ffd400" stroke="#0d1620" stroke-width="2.5" stroke-linejoin="round"/></svg>`;
const SUSPECT = `<svg width="40" height="40" viewBox="-20 -20 40 40" aria-hidden="true"><circle r="16" fill="#b00020" stroke="#fff" stroke-width="3"/><path d="M0-9V3M0 8V9" stroke="#fff" stroke-width="4" stroke-linecap="round"/></svg>`;

const icon = (html, size, name = "") => L.divIcon({ html, className: "mark " + name, iconSize: [size, size] });

/** Tiles from the service itself: an image cannot send the token, a request can. */
const OwnTiles = L.TileLayer.extend({
  createTile(coords, done) {
    const tile = document.createElement("img");
    tile.alt = "";
    ask(this.getTileUrl(coords))
      .then(async (answer) => {
        tile.onload = () => URL.revokeObjectURL(tile.src);
        tile.src = URL.createObjectURL(await answer.blob());
        done(null, tile);
      })
      .catch((error) => done(error, tile));
    return tile;
  },
});

/** `parts`: key, name, and whether it is shown at first. */
export const LAYERS = [
  ["belief", "where the target may be", true],
  ["pod", "how well it was looked at", true],
  ["regions", "regions of interest and their mass", true],
  ["track", "track flown", true],
  ["footprint", "footprint now", true],
  ["ahead", "way ahead", true],
  ["hits", "detector hits", true],
  ["area", "area, exclusions, launch", true],
  ["tiles", "ground map", true],
];

export class Chart {
  /** `kept`: { centre, zoom, hidden } of an earlier visit, or nothing; `moved(view)` is told when the view changes. */
  constructor(element, run, kept, moved, onSuspect) {
    this.run = run;
    this.onSuspect = onSuspect;
    const { frame, tiles } = run.scene;
    this.map = L.map(element, { zoomSnap: 0.1, zoomDelta: 0.5, maxZoom: 21, attributionControl: !!tiles?.attribution, preferCanvas: false });
    this.map.attributionControl?.setPrefix(false);
    L.control.scale({ imperial: false, maxWidth: 160 }).addTo(this.map);
    for (const [name, height] of [["cells", 350], ["pod", 351], ["ground", 360], ["flight", 420]]) this.map.createPane(name).style.zIndex = height;
    if (kept) this.map.setView(kept.centre, kept.zoom);
    else this.map.fitBounds(L.latLngBounds(frame.corners), { padding: [10, 10] });
    this.hidden = new Set(kept?.hidden ?? []);
    this.layers = this.make(frame, tiles);
    for (const [key] of LAYERS) if (!this.hidden.has(key)) this.layers[key]?.addTo(this.map);
    this.moved = () => moved(this.view());
    this.map.on("moveend", this.moved);
    new ResizeObserver(() => this.map.invalidateSize({ pan: false })).observe(element);
  }

  view() {
    const { lat, lng } = this.map.getCenter();
    return { centre: [lat, lng], zoom: this.map.getZoom(), hidden: [...this.hidden] };
  }

  toggle(key, shown) {
    this.hidden[shown ? "delete" : "add"](key);
    if (shown) this.layers[key].addTo(this.map);
    else this.layers[key].remove();
    this.moved();
  }

  make(frame, tiles) {
    const scene = this.run.scene, fine = frame.rows * frame.cols <= MOST_FINE_CELLS;
    this.belief = new Cells({ ...frame }, 1, "Heat layer: probability of each cell");
    this.belief.options = { pane: "cells" };
    this.pod = new Cells({ ...frame }, fine ? 8 : 1, "Layer: probability of detection so far of each cell");
    this.pod.options = { pane: "pod" };
    this.inset = fine ? 2 : 0;
    const flight = { pane: "flight", interactive: false };
    this.trackLine = L.polyline([], { ...flight, color: "#fff", weight: 5, opacity: 0.8 });
    this.trackTop = L.polyline([], { ...flight, color: INK, weight: 2.25 });
    this.aheadLine = L.polyline([], { ...flight, color: BLUE, weight: 3.5, opacity: 0.85, lineCap: "round", dashArray: "1 9" });
    this.goal = L.circleMarker([0, 0], { ...flight, radius: 6, color: BLUE, weight: 3, fillColor: "#fff", fillOpacity: 1 });
    this.seen = L.layerGroup();
    this.hitMarks = L.layerGroup();
    this.labels = new Map();
    this.craft = L.marker([0, 0], { icon: icon(CRAFT, 36, "craft"), interactive: false, keyboard: false, alt: "aircraft", zIndexOffset: 1000 });
    this.places = L.layerGroup().addTo(this.map); // suspects and the place found are never hidden
    return {
      belief: this.belief,
      pod: this.pod,
      regions: this.makeRegions(scene),
      track: L.layerGroup([this.trackLine, this.trackTop]),
      footprint: this.seen,
      ahead: L.layerGroup([this.aheadLine]),
      hits: this.hitMarks,
      area: this.makeArea(scene),
      tiles: tiles && this.makeTiles(tiles),
    };
  }

  makeTiles(tiles) {
    const options = { attribution: tiles.attribution, minNativeZoom: tiles.min_zoom, maxNativeZoom: tiles.max_zoom, maxZoom: 21, opacity: 0.75 };
    return tiles.own ? new OwnTiles(tiles.url, options) : L.tileLayer(tiles.url, { ...options, referrerPolicy: "no-referrer" });
  }

  makeArea(scene) {
    const style = ({ properties }) =>
      properties.role === "exclude"
        ? { color: RED, weight: 2.5, dashArray: "6 4", fillColor: RED, fillOpacity: properties.searchable ? 0.08 : 0.22 }
        : { color: INK, weight: 2.5, fill: false };
    return L.geoJSON(scene.features, {
      style,
      pane: "ground",
      interactive: false,
      pointToLayer: (_, place) => L.marker(place, { icon: icon(LAUNCH, 26), interactive: false, keyboard: false, alt: "launch" }),
    });
  }

  makeRegions(scene) {
    const outlines = L.geoJSON(scene.regions, { pane: "ground", interactive: false, style: { color: "#5b2a91", weight: 2, opacity: 0.9, fill: false } });
    for (const { properties } of scene.regions.features) {
      const mark = L.marker(properties.label, { icon: L.divIcon({ className: "roi", html: "<span></span>" }), interactive: false, keyboard: false, zIndexOffset: -500 });
      this.labels.set(properties.number, mark);
      outlines.addLayer(mark);
    }
    return outlines;
  }

  /** Draw what has changed. */
  draw(changed) {
    const { run } = this, { state } = run;
    if (changed.has("belief")) {
      this.top = topOf(run);
      this.belief.paint(run.codes, heatColours(run, this.top));
    }
    if (changed.has("pod")) this.pod.paint(run.pod, podColours(), this.inset);
    if (changed.has("track")) {
      this.trackLine.setLatLngs(run.track);
      this.trackTop.setLatLngs(run.track);
    }
    if (changed.has("hits")) {
      this.hitMarks.clearLayers();
      for (const hit of run.hits)
        this.hitMarks.addLayer(L.circleMarker(hit, { pane: "flight", interactive: false, radius: 5, color: "#fff", weight: 1.5, fillColor: ORANGE, fillOpacity: 1 }));
    }
    this.aheadLine.setLatLngs(state.ahead ?? []);
    if (state.ahead?.length) this.goal.setLatLng(state.ahead.at(-1)).addTo(this.layers.ahead);
    else this.goal.removeFrom(this.layers.ahead);
    for (const [number, mark] of this.labels) {
      const said = `ROI ${number} · ${percent(state.regions?.[number - 1] ?? 0)}`;
      const span = mark.getElement()?.firstChild;
      if (span && span.textContent !== said) span.textContent = said;
    }
    this.drawCraft(state);
    this.drawPlaces(state);
  }

  drawCraft({ pose, footprint }) {
    this.seen.clearLayers();
    for (const cell of footprint.cells)
      this.seen.addLayer(L.polygon(cell.corners, { pane: "flight", interactive: false, color: BLUE, weight: 2, fillColor: BLUE, fillOpacity: footprint.counts ? 0.25 : 0.05, dashArray: footprint.counts ? null : "3 4" }));
    if (!pose) return void this.craft.remove();
    this.craft.setLatLng([pose.lat, pose.lon]).addTo(this.map);
    this.craft.getElement().querySelector("g").setAttribute("transform", `rotate(${pose.heading_deg})`);
  }

  drawPlaces({ suspects, found }) {
    const wanted = JSON.stringify([suspects?.map((each) => [each.lat, each.lon]), found]);
    if (wanted === this.shownPlaces) return;
    this.shownPlaces = wanted;
    this.places.clearLayers();
    for (const each of suspects ?? []) {
      const mark = L.marker([each.lat, each.lon], { icon: icon(SUSPECT, 40), alt: "possible target", title: "possible target" });
      this.places.addLayer(mark.on("click", () => this.onSuspect(each)));
    }
    if (!found) return;
    if (found.ellipse) this.places.addLayer(L.polygon(ellipse(found), { pane: "flight", interactive: false, color: INK, weight: 2.5, fillColor: "#ffd400", fillOpacity: 0.3 }));
    this.places.addLayer(L.marker([found.lat, found.lon], { icon: icon(FOUND, 44), interactive: false, keyboard: false, alt: "found here", zIndexOffset: 900 }));
  }

  goTo(place) {
    this.map.setView([place.lat, place.lon], Math.max(this.map.getZoom(), 18));
  }
}

/** The border of an error ellipse as positions. */
function ellipse({ lat, lon, ellipse: { semi_major_m: a, semi_minor_m: b, bearing_deg: bearing } }) {
  const turn = (bearing * Math.PI) / 180, metre = 1 / 111195, narrow = Math.cos((lat * Math.PI) / 180);
  return Array.from({ length: 48 }, (_, i) => {
    const along = a * Math.cos((i * Math.PI) / 24), across = b * Math.sin((i * Math.PI) / 24);
    const north = along * Math.cos(turn) - across * Math.sin(turn), east = along * Math.sin(turn) + across * Math.cos(turn);
    return [lat + north * metre, lon + (east * metre) / narrow];
  });
}
