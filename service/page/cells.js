// Layers of cells: a small canvas that the browser stretches and turns over the grid, and the colours on it.

import { isNight } from "./themes.js";

/** @import { Run } from "./run.js" */

const L = window.L;

/** A canvas over the grid with `scale` pixels a cell. */
export const Cells = L.Layer.extend({
  /**
   * @param {Frame} frame
   * @param {number} scale
   * @param {string} label */
  initialize(frame, scale, label) {
    this.frame = frame;
    this.scale = scale;
    this.canvas = L.DomUtil.create("canvas", "cells leaflet-zoom-animated");
    this.canvas.width = frame.cols * scale;
    this.canvas.height = frame.rows * scale;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", label);
    this.context = this.canvas.getContext("2d");
    this.image = this.context.createImageData(this.canvas.width, this.canvas.height);
    this.pixels = new Uint32Array(this.image.data.buffer);
  },
  onAdd() {
    this.getPane().appendChild(this.canvas);
    this.place();
  },
  onRemove() {
    this.canvas.remove();
  },
  getEvents() {
    return { viewreset: this.place, zoom: this.place, zoomanim: this.animate };
  },
  place() {
    this.turn(
      this.frame.corners.map((/** @type {Place} */ corner) => this._map.latLngToLayerPoint(corner)),
    );
  },
  /** @param {{ zoom: number, center: Place }} event where a zoom under way leads */
  animate(event) {
    this.turn(
      this.frame.corners.map((/** @type {Place} */ corner) =>
        this._map._latLngToNewLayerPoint(L.latLng(corner), event.zoom, event.center),
      ),
    );
  },
  /** @param {any[]} corners the grid's, as points of the layer: north-west first, clockwise */
  turn([nw, ne, , sw]) {
    const { width, height } = this.canvas;
    const across = ne.subtract(nw).divideBy(width),
      down = sw.subtract(nw).divideBy(height);
    this.canvas.style.transform = `matrix(${across.x},${across.y},${down.x},${down.y},${nw.x},${nw.y})`;
  },
  /** Paint every cell with the colour (as a little-endian ABGR number) of its code; `inset` pixels stay free around.
   * @param {Uint8Array} codes
   * @param {Uint32Array} colours
   * @param {number} inset */
  paint(codes, colours, inset = 0) {
    const { rows, cols } = this.frame,
      s = this.scale,
      width = cols * s;
    if (s === 1) codes.forEach((code, i) => (this.pixels[i] = colours[code]));
    else {
      for (let row = 0, i = 0; row < rows; row++) {
        for (let col = 0; col < cols; col++, i++) {
          const colour = colours[codes[i]];
          for (let y = inset; y < s - inset; y++) {
            const start = (row * s + y) * width + col * s;
            this.pixels.fill(colour, start + inset, start + s - inset);
          }
        }
      }
    }
    this.context.putImageData(this.image, 0, 0);
  },
});

/** @type {Colour[]} */
const HEAT = [
  [255, 247, 188],
  [254, 217, 118],
  [253, 160, 60],
  [240, 84, 30],
  [189, 17, 40],
  [98, 8, 66],
];
/** The same for a dark ground: what stands out is bright. @type {Colour[]} */
const HEAT_AT_NIGHT = [
  [60, 26, 84],
  [112, 24, 88],
  [186, 40, 70],
  [238, 92, 40],
  [254, 178, 76],
  [255, 244, 190],
];
const DECADES = 3,
  MOST_DECADES = 9;

/** The colour of a place on the scale: pale for long, so that what stands out does.
 * @param {Colour[]} stops
 * @param {number} part
 * @returns {Colour} */
function mix(stops, part) {
  const at = Math.min(1, Math.max(0, part)) ** 1.4 * (stops.length - 1);
  const low = Math.min(stops.length - 2, Math.floor(at));
  return /** @type {Colour} */ (
    stops[low].map((value, i) => value + (stops[low + 1][i] - value) * (at - low))
  );
}

/** A colour as a pixel has it.
 * @param {Colour} colour
 * @param {number} alpha */
const packed = ([r, g, b], alpha) =>
  ((Math.round(255 * alpha) << 24) |
    (Math.round(b) << 16) |
    (Math.round(g) << 8) |
    Math.round(r)) >>>
  0;

const heat = () => (isNight() ? HEAT_AT_NIGHT : HEAT);

/** @param {number} part */
const heatAlpha = (part) => 0.15 + 0.72 * Math.min(1, part * 1.25);

/** What the colours mean: the largest probability on the scale, and how many decades it goes down from there.
 * @typedef {{ top: number, decades: number }} Scale */

/** The scale of a belief: its peak, rounded up to 1, 2 or 5, so that colours do not flicker; and three decades, or as
 * many as it takes to tell the ground apart where one cell holds nearly all, as after a find.
 * @param {Run} run
 * @returns {Scale} */
export function scaleOf(run) {
  const known = run.codes.filter((code) => code > 0).sort();
  const peak = run.probability(known.at(-1) ?? 0),
    low = run.probability(known[Math.floor(known.length / 4)] ?? 0);
  const decade = 10 ** Math.floor(Math.log10(peak || 1));
  const steps = [1, 2, 5, 10].map((each) => each * decade);
  const top = Math.min(1, steps.find((each) => each >= peak * 0.999) ?? 1);
  const reach = DECADES * Math.ceil(Math.log10(peak / low) / DECADES || 1);
  return { top, decades: Math.min(MOST_DECADES, Math.max(DECADES, reach)) };
}

/** A colour for each code of the belief: logarithmic, down from the top of the scale.
 * @param {Run} run
 * @param {Scale} scale */
export function heatColours(run, { top, decades }) {
  const colours = new Uint32Array(256);
  for (let code = 1; code < 256; code++) {
    const part = 1 + Math.log10(run.probability(code) / top) / decades;
    colours[code] = part <= 0 ? 0 : packed(mix(heat(), part), heatAlpha(part));
  }
  return colours;
}

/** @type {Colour} */
const LOOKED = [0, 92, 110];
/** @type {Colour} */
const LOOKED_AT_NIGHT = [70, 200, 220];
const looked = () => (isNight() ? LOOKED_AT_NIGHT : LOOKED);

/** A colour for each POD: the surer, the more of it. */
export function podColours() {
  return Uint32Array.from({ length: 256 }, (_, code) =>
    code ? packed(looked(), 0.12 + 0.6 * (code / 255)) : 0,
  );
}

/** The scale of a legend.
 * @param {HTMLCanvasElement} canvas
 * @param {(part: number) => number} colour */
function ramp(canvas, colour) {
  canvas.width = 200;
  canvas.height = 1;
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")),
    image = context.createImageData(200, 1);
  new Uint32Array(image.data.buffer).forEach((_, i, pixels) => (pixels[i] = colour(i / 199)));
  context.putImageData(image, 0, 0);
}

/** @param {HTMLCanvasElement} canvas */
export const heatRamp = (canvas) =>
  ramp(canvas, (part) => packed(mix(heat(), part), heatAlpha(part)));
/** @param {HTMLCanvasElement} canvas */
export const podRamp = (canvas) =>
  ramp(canvas, (part) => (part ? packed(looked(), 0.12 + 0.6 * part) : 0));

/** A probability for people: two digits, as a percentage; never 100 %, and never 0 % where it is more.
 * @param {number} part */
export function percent(part) {
  if (part >= 0.995) return "over 99 %";
  if (part >= 0.0995) return (100 * part).toFixed(0) + " %";
  if (part >= 1e-5) return Number((100 * part).toPrecision(1)) + " %";
  return part > 0 ? "under 0.001 %" : "0 %";
}

/** To a tenth of a percent; never 100 %.
 * @param {number} part */
export const tenths = (part) => (part < 0.9995 ? `${(100 * part).toFixed(1)} %` : "over 99.9 %");

/** How sure: never 100 %.
 * @param {number} part */
export const certainty = (part) => (part < 0.995 ? percent(part) : tenths(part));

/** One figure, however small.
 * @param {number} part */
const tick = (part) =>
  (100 * part).toFixed(Math.max(0, -Math.floor(Math.log10(100 * part) + 1e-9))) + " %";

/** @param {Scale} scale */
export const heatTicks = ({ top, decades }) =>
  [3, 2, 1, 0].map((third) => tick(top / 10 ** ((third * decades) / 3)));
