// The map: ground, area, belief, POD, regions, flight. Works without internet.

import { Cells, heatColours, percent, podColours, scaleOf } from "./cells.js";
import { several } from "./fleet.js";
import { drawTrack, Flock } from "./flock.js";
import { CRAFT, ellipse, FOUND, icon, LAUNCH, nameMark, placeNorth, SUSPECT } from "./marks.js";
import { onTheme } from "./themes.js";
import { OwnTiles } from "./tiles.js";

/** @import { Run } from "./run.js" */

const L = window.L;
const MOST_FINE_CELLS = 60000; // beyond, a cell is one pixel of the POD layer
const BLUE = "#0b4aa2",
  ORANGE = "#d95f02";

/** Name of a layer, what it says, and whether it is shown at first.
 * @type {[LayerName, string, boolean][]} */
export const LAYERS = [
  ["belief", "where it may be", true],
  ["pod", "what was searched", true],
  ["regions", "likely places and their chance", true],
  ["names", "names from the area file", true],
  ["track", "track flown", true],
  ["footprint", "what the camera sees now", true],
  ["ahead", "way ahead", true],
  ["hits", "detector hits", true],
  ["area", "area, exclusions, launch", true],
  ["news", "news from the field", true],
  ["tiles", "ground map", true],
];

export class Chart {
  /** The label of each region, by its number. @type {Map<number, any>} */
  labels = new Map();

  /** Which news `drawNews` has drawn, as text. @type {string | undefined} */
  shownNews;
  /** What `drawPlaces` has drawn, as text. @type {string | undefined} */
  shownPlaces;
  /** Several aircraft; see `make`. @type {Flock} */
  flock = /** @type {any} */ (null);
  /** What the colours of the belief mean. */
  scale = { top: 1, decades: 3 };

  /** `kept`: the view of an earlier visit, or nothing; `moved(view)` is told when the view changes.
   * @param {HTMLElement} element
   * @param {Run} run
   * @param {View | null} kept
   * @param {(view: View) => void} moved
   * @param {(suspect: SuspectState) => void} onSuspect */
  constructor(element, run, kept, moved, onSuspect) {
    this.run = run;
    this.onSuspect = onSuspect;
    const { frame, tiles } = run.scene;
    this.map = L.map(element, {
      zoomSnap: 0.1,
      zoomDelta: 0.5,
      maxZoom: 21,
      attributionControl: !!tiles?.attribution,
      preferCanvas: false,
    });
    this.map.attributionControl?.setPrefix(false);
    L.control.scale({ imperial: false, maxWidth: 160 }).addTo(this.map);
    for (const [name, height] of [
      ["cells", 350],
      ["pod", 351],
      ["ground", 360],
      ["flight", 420],
    ]) {
      this.map.createPane(name).style.zIndex = height;
    }
    if (kept) this.map.setView(kept.centre, kept.zoom);
    else this.fit();
    /** Layers that are switched off. @type {Set<string>} */
    this.hidden = new Set(kept?.hidden ?? []);
    /** Which of the two views is shown. @type {"belief" | "pod"} */
    this.shows = kept?.shows ?? "belief";
    this.layers = this.make(frame, tiles);
    for (const [key] of LAYERS) if (this.isShown(key)) this.layers[key]?.addTo(this.map);
    placeNorth(this.map);
    onTheme(() => this.repaint());
    this.moved = () => moved(this.view());
    this.map.on("moveend", this.moved);
    new ResizeObserver(() => this.map.invalidateSize({ pan: false })).observe(element);
  }

  /** @returns {View} */
  view() {
    const { lat, lng } = this.map.getCenter();
    return {
      centre: [lat, lng],
      zoom: this.map.getZoom(),
      hidden: [...this.hidden],
      shows: this.shows,
    };
  }

  /** The whole area. */
  fit() {
    this.map.fitBounds(L.latLngBounds(this.run.scene.frame.corners), { padding: [10, 10] });
  }

  /** @param {LayerName} key */
  isShown(key) {
    const views = ["belief", "pod"];
    return views.includes(key) ? key === this.shows : !this.hidden.has(key);
  }

  /** Show where it may be, or what was searched.
   * @param {"belief" | "pod"} view */
  show(view) {
    this.layers[this.shows].remove();
    this.shows = view;
    this.layers[view].addTo(this.map);
    this.onView(this);
    this.moved();
  }

  /** @type {(chart: Chart) => void} */
  onView = () => undefined;

  /** The colours of the screen have changed. */
  repaint() {
    if (!this.run.state) return;
    this.draw(new Set(/** @type {Changing[]} */ (["belief", "pod"])));
    this.onView(this);
  }

  /**
   * @param {LayerName} key
   * @param {boolean} shown */
  toggle(key, shown) {
    this.hidden[shown ? "delete" : "add"](key);
    if (shown) this.layers[key].addTo(this.map);
    else this.layers[key].remove();
    this.moved();
  }

  /**
   * @param {Frame} frame
   * @param {Tiles | null | undefined} tiles
   * @returns {Record<LayerName, any>} */
  make(frame, tiles) {
    const scene = this.run.scene,
      fine = frame.rows * frame.cols <= MOST_FINE_CELLS;
    this.belief = new Cells({ ...frame }, 1, "Heat layer: probability of area, cell by cell");
    this.belief.options = { pane: "cells" };
    this.pod = new Cells(
      { ...frame },
      fine ? 8 : 1,
      "Layer: probability of detection so far, cell by cell",
    );
    this.pod.options = { pane: "pod" };
    this.inset = fine ? 2 : 0;
    const flight = { pane: "flight", interactive: false };
    this.trackLine = L.polyline([], {
      ...flight,
      className: "casing",
      weight: 5,
      opacity: 0.8,
    });
    this.trackTop = L.polyline([], { ...flight, className: "ink-line", weight: 2.25 });
    this.aheadLine = L.polyline([], {
      ...flight,
      className: "blue-line",
      weight: 3.5,
      opacity: 0.85,
      lineCap: "round",
      dashArray: "1 9",
    });
    this.goal = L.circleMarker([0, 0], {
      ...flight,
      radius: 6,
      color: BLUE,
      weight: 3,
      fillColor: "#fff",
      fillOpacity: 1,
    });
    this.seen = L.layerGroup();
    this.hitMarks = L.layerGroup();
    this.newsOf = L.layerGroup();
    this.craft = L.marker([0, 0], {
      icon: icon(CRAFT, 36, "craft"),
      interactive: false,
      keyboard: false,
      alt: "aircraft",
      zIndexOffset: 1000,
    });
    this.trackOf = L.layerGroup([this.trackLine, this.trackTop]);
    this.wayOf = L.layerGroup([this.aheadLine]);
    this.flock = new Flock(this.map, this.trackOf, this.wayOf);
    this.places = L.layerGroup().addTo(this.map); // suspects and the place found are never hidden
    return {
      belief: this.belief,
      pod: this.pod,
      regions: this.makeRegions(scene),
      names: this.makeNames(scene),
      track: this.trackOf,
      footprint: this.seen,
      ahead: this.wayOf,
      hits: this.hitMarks,
      area: this.makeArea(scene),
      news: this.newsOf,
      tiles: tiles && this.makeTiles(tiles),
    };
  }

  /** @param {Tiles} tiles */
  makeTiles(tiles) {
    const options = {
      attribution: tiles.attribution,
      minNativeZoom: tiles.min_zoom,
      maxNativeZoom: tiles.max_zoom,
      maxZoom: 21,
      opacity: 0.75,
    };
    return tiles.own
      ? new OwnTiles(tiles.url, options)
      : L.tileLayer(tiles.url, { ...options, referrerPolicy: "no-referrer" });
  }

  /** @param {Scene} scene */
  makeArea(scene) {
    const style = (/** @type {Feature} */ { properties }) =>
      properties.role === "exclude"
        ? {
            className: properties.searchable ? "never searchable" : "never",
            weight: 2.5,
            dashArray: "6 4",
          }
        : { className: "ink-line", weight: 2.5, fill: false };
    return L.geoJSON(scene.features, {
      style,
      pane: "ground",
      interactive: false,
      pointToLayer: (/** @type {Feature} */ _, /** @type {unknown} */ place) =>
        L.marker(place, {
          icon: icon(LAUNCH, 26),
          interactive: false,
          keyboard: false,
          alt: "launch",
        }),
    });
  }

  /** @param {Scene} scene */
  makeRegions(scene) {
    const outlines = L.geoJSON(scene.regions, {
      pane: "ground",
      interactive: false,
      style: { className: "violet-line", weight: 2, opacity: 0.9, fill: false },
    });
    for (const { properties } of scene.regions.features) {
      const mark = nameMark(properties.label, scene.names[properties.number - 1], "likely");
      this.labels.set(properties.number, mark);
      outlines.addLayer(mark);
    }
    return outlines;
  }

  /** Draw the likely places of the scene anew, and the names that they leave. */
  redraw() {
    const { scene } = this.run;
    this.layers.regions.remove();
    this.layers.names.remove();
    this.labels.clear();
    this.layers.regions = this.makeRegions(scene);
    this.layers.names = this.makeNames(scene);
    for (const key of /** @type {LayerName[]} */ (["regions", "names"])) {
      if (this.isShown(key)) this.layers[key].addTo(this.map);
    }
  }

  /** The names that no likely place has already.
   * @param {Scene} scene */
  makeNames({ places, names }) {
    const others = places.filter(({ name }) => !names.some((each) => each.startsWith(name)));
    return L.layerGroup(others.map(({ name, role, lat, lon }) => nameMark([lat, lon], name, role)));
  }

  /** Draw what has changed.
   * @param {Set<Changing>} changed */
  draw(changed) {
    const { run } = this,
      { state } = run;
    if (changed.has("belief")) {
      this.scale = scaleOf(run);
      this.belief.paint(run.codes, heatColours(run, this.scale));
    }
    if (changed.has("pod")) this.pod.paint(run.pod, podColours(), this.inset);
    if (changed.has("hits")) {
      this.hitMarks.clearLayers();
      for (const hit of run.hits) {
        this.hitMarks.addLayer(
          L.circleMarker(hit, {
            pane: "flight",
            interactive: false,
            radius: 5,
            color: "#fff",
            weight: 1.5,
            fillColor: ORANGE,
            fillOpacity: 1,
          }),
        );
      }
    }
    for (const [number, mark] of this.labels) {
      const name = run.scene.names[number - 1];
      const said = `${name} · ${percent(state.regions?.[number - 1] ?? 0)}`;
      const span = mark.getElement()?.firstChild;
      if (span && span.textContent !== said) span.textContent = said;
    }
    this.drawNews(state.news);
    this.drawFlight(state);
    this.drawPlaces(state);
  }

  /** Who flies: several in their colours, or the one.
   * @param {RunState} state */
  drawFlight(state) {
    const fleet = several(state) ? state.aircraft : [],
      { tracks } = this.run;
    this.flock.draw(fleet, tracks);
    drawTrack([this.trackLine, this.trackTop], fleet.length ? [] : (tracks[0] ?? []));
    this.drawWay(fleet.length ? [] : (state.ahead ?? []));
    this.drawCraft(state, fleet);
  }

  /** @param {Place[]} ahead */
  drawWay(ahead) {
    this.aheadLine.setLatLngs(ahead);
    if (ahead.length) this.goal.setLatLng(ahead.at(-1)).addTo(this.layers.ahead);
    else this.goal.removeFrom(this.layers.ahead);
  }

  /** @param {RunState} state
   * @param {AircraftState[]} fleet */
  drawCraft({ pose, footprint }, fleet) {
    this.seen.clearLayers();
    for (const seen of fleet.length ? fleet.map((each) => each.footprint) : [footprint]) {
      this.drawSeen(seen);
    }
    if (!pose || fleet.length) return void this.craft.remove();
    this.craft.setLatLng([pose.lat, pose.lon]).addTo(this.map);
    this.craft
      .getElement()
      .querySelector("g")
      .setAttribute("transform", `rotate(${pose.heading_deg ?? 0})`);
  }

  /** @param {FootprintState} footprint */
  drawSeen(footprint) {
    for (const cell of footprint.cells) {
      this.seen.addLayer(
        L.polygon(cell.corners, {
          pane: "flight",
          interactive: false,
          className: "seen",
          weight: 2,
          fillOpacity: footprint.counts ? 0.25 : 0.05,
          dashArray: footprint.counts ? null : "3 4",
        }),
      );
    }
  }

  /** Where the news are that stand: what is not flown over as the exclusions of the area.
   * @param {NewsState[]} news */
  drawNews(news) {
    const wanted = JSON.stringify(news.map(({ id }) => id));
    if (wanted === this.shownNews) return;
    this.shownNews = wanted;
    this.newsOf.clearLayers();
    for (const { role, geometry } of news) {
      if (!geometry) continue;
      const style = {
        className: role === "exclude" ? "never searchable" : `told ${role}`,
        weight: 2.5,
        dashArray: role === "exclude" ? "6 4" : null,
      };
      this.newsOf.addLayer(
        L.geoJSON(geometry, {
          style,
          pane: "ground",
          interactive: false,
          pointToLayer: (/** @type {Feature} */ _, /** @type {unknown} */ place) =>
            L.circleMarker(place, { ...style, pane: "ground", interactive: false, radius: 8 }),
        }),
      );
    }
  }

  /** @param {RunState} state */
  drawPlaces({ suspects, found }) {
    const wanted = JSON.stringify([suspects?.map((each) => [each.lat, each.lon]), found]);
    if (wanted === this.shownPlaces) return;
    this.shownPlaces = wanted;
    this.places.clearLayers();
    for (const each of suspects ?? []) {
      const mark = L.marker([each.lat, each.lon], {
        icon: icon(SUSPECT, 40),
        alt: "possible target",
        title: "possible target",
      });
      this.places.addLayer(mark.on("click", () => this.onSuspect(each)));
    }
    if (!found) return;
    if (found.ellipse) {
      this.places.addLayer(
        L.polygon(ellipse(found), {
          pane: "flight",
          interactive: false,
          className: "ink-line",
          weight: 2.5,
          fillColor: "#ffd400",
          fillOpacity: 0.3,
        }),
      );
    }
    this.places.addLayer(
      L.marker([found.lat, found.lon], {
        icon: icon(FOUND, 44, "find"),
        interactive: false,
        keyboard: false,
        alt: "found here",
        zIndexOffset: 900,
      }),
    );
  }

  /** @param {{ lat: number, lon: number }} place */
  goTo(place) {
    this.map.setView([place.lat, place.lon], Math.max(this.map.getZoom(), 18));
  }
}
