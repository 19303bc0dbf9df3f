// What the map shows: the switch of each layer with its key, and the scale of its colours.

import { heatRamp, heatTicks, podRamp } from "./cells.js";
import { $, draw, make } from "./dom.js";
import { LAYERS } from "./map.js";

/** @import { Scale } from "./cells.js" */
/** @import { Chart } from "./map.js" */

/** @param {Record<string, string | number>} attributes */
const line = (attributes) => [draw("line", { x1: 1, x2: 31, y1: 8, y2: 8, ...attributes })];
/** @type {Partial<Record<LayerName, () => SVGElement[]>>} */
const KEYS = {
  regions: () => line({ class: "violet-line", "stroke-width": 2.5 }),
  track: () => line({ class: "ink-line", "stroke-width": 2.5 }),
  footprint: () => [
    draw("rect", {
      x: 9,
      y: 1,
      width: 14,
      height: 14,
      class: "seen",
      "stroke-width": 2,
    }),
  ],
  ahead: () =>
    line({
      class: "blue-line",
      "stroke-width": 4,
      "stroke-linecap": "round",
      "stroke-dasharray": "1 8",
    }),
  news: () => [
    draw("circle", { cx: 8, cy: 8, r: 6, class: "told clue", "stroke-width": 2.5 }),
    draw("rect", {
      x: 19,
      y: 3,
      width: 10,
      height: 10,
      class: "told searched",
      "stroke-width": 2.5,
    }),
  ],
  hits: () => [draw("circle", { cx: 16, cy: 8, r: 5, fill: "#d95f02" })],
  area: () => [
    draw("rect", {
      x: 2,
      y: 2,
      width: 12,
      height: 12,
      class: "ink-line",
      "stroke-width": 2.5,
    }),
    draw("rect", {
      x: 19,
      y: 3,
      width: 10,
      height: 10,
      class: "never",
      "stroke-width": 2,
      "stroke-dasharray": "4 2",
    }),
  ],
};

/** The layer switch, each layer with its key, and the legend of what is shown.
 * @param {Chart} chart */
export function showLayers(chart) {
  const rows = [];
  for (const [key, name] of LAYERS) {
    if (!chart.layers[key] || key === "belief" || key === "pod") continue;
    const box = make("input", {
      type: "checkbox",
      checked: !chart.hidden.has(key),
      id: "layer-" + key,
    });
    box.addEventListener("change", () => chart.toggle(key, box.checked));
    const label = make("label", {}, box, make("span", { textContent: name }));
    const drawn = KEYS[key];
    if (drawn) {
      const svg = draw("svg", { class: "key", viewBox: "0 0 32 16", "aria-hidden": "true" });
      svg.append(...drawn());
      label.insertBefore(svg, label.lastChild);
    }
    rows.push(make("li", {}, label));
  }
  $("layers").replaceChildren(...rows);
  showLegend(chart);
}

/** @param {Chart} chart */
export function showLegend({ shows, scale }) {
  $("legend").replaceChildren(legend(shows));
  if (shows === "belief") showScale(scale);
}

/** @param {"belief" | "pod"} key */
function legend(key) {
  const canvas = make("canvas", { className: "ramp" });
  canvas.setAttribute("role", "img");
  canvas.setAttribute(
    "aria-label",
    key === "belief"
      ? "Colours from improbable to probable"
      : "Colours from not looked at to well looked at",
  );
  (key === "belief" ? heatRamp : podRamp)(canvas);
  const ticks = make("div", { className: "ticks", id: "ticks-" + key });
  if (key === "pod") {
    ticks.append(
      ...["POD 0 %", "50 %", "100 %"].map((text) => make("span", { textContent: text })),
    );
  }
  return make("div", { className: "legend" }, canvas, ticks);
}

/** The ends of the belief's scale, a cell.
 * @param {Scale} scale */
export function showScale(scale) {
  const texts = heatTicks(scale),
    ticks = document.getElementById("ticks-belief"); // not there before the layers are shown
  texts[0] = "≤ " + texts[0];
  texts[3] += " a cell";
  if (ticks && ticks.textContent !== texts.join("")) {
    ticks.replaceChildren(...texts.map((text) => make("span", { textContent: text })));
  }
}
