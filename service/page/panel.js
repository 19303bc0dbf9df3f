// The numbers beside the map.

import { heatRamp, heatTicks, percent, podRamp } from "./cells.js";
import { LAYERS } from "./map.js";

export const $ = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";

/** An element with properties and children. */
export function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

function draw(tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

/** Write only what is new: a screen reader is told of every change. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Seconds for people. */
export function lasting(seconds) {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h ${Math.round((seconds % 3600) / 60)} min`;
}

export function showPos(run) {
  const { state } = run;
  say($("pos"), (100 * state.pos).toFixed(1) + " %");
  const estimate = state.estimate;
  const wanted = (estimate?.goals ?? []).map(({ pos, reached, seconds }) => [
    `to ${Math.round(100 * pos)} %`,
    reached ? "reached" : seconds !== null ? "in " + lasting(seconds) : estimate.reachable < pos ? "out of reach" : "later",
  ]);
  const kept = $("goals").children;
  if (kept.length !== wanted.length)
    $("goals").replaceChildren(...wanted.map(() => make("div", {}, make("dt"), make("dd"))));
  wanted.forEach(([name, value], i) => {
    say(kept[i].firstChild, name);
    say(kept[i].lastChild, value);
  });
  const left = state.flight_left_s;
  const over = estimate?.goals.find((goal) => !goal.reached && goal.seconds !== null && left !== null && goal.seconds > left);
  const limit = estimate && estimate.reachable < 0.95 ? ` At most ${percent(estimate.reachable)} can be reached: the rest lies outside the area or where the drone may not fly.` : "";
  say($("basis"), estimate ? `Estimate: ${estimate.basis}.${limit}${over ? ` The battery ends before ${Math.round(100 * over.pos)} %.` : ""}` : "");
}

export function showCurve(run) {
  const points = run.curve, { state } = run;
  const width = 340, height = 130, left = 42, bottom = 20, top = 6;
  const longest = Math.max(60, points.at(-1)?.[0] ?? 0);
  const x = (seconds) => left + ((width - left - 4) * seconds) / longest;
  const y = (pos) => top + (height - top - bottom) * (1 - pos);
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `POS over time: ${percent(state.pos)} after ${lasting(longest)}` });
  for (const pos of [0, 0.25, 0.5, 0.75, 1]) {
    svg.append(draw("line", { x1: left, x2: width - 4, y1: y(pos), y2: y(pos), stroke: "#c3cad2", "stroke-width": 1 }));
    if (pos !== 0.25 && pos !== 0.75) svg.append(draw("text", { x: left - 4, y: y(pos) + 4, "text-anchor": "end" }, `${100 * pos} %`));
  }
  const shown = [...points, [longest, points.at(-1)?.[1] ?? 0]];
  const path = shown.map(([s, p], i) => `${i ? "L" : "M"}${x(s).toFixed(1)} ${y(p).toFixed(1)}`).join("");
  svg.append(draw("path", { d: `${path}L${x(longest)} ${y(0)}L${x(0)} ${y(0)}Z`, fill: "#0b4aa2", "fill-opacity": 0.12 }));
  svg.append(draw("path", { d: path, fill: "none", stroke: "#0b4aa2", "stroke-width": 2.5, "stroke-linejoin": "round" }));
  svg.append(draw("text", { x: left, y: height - 5 }, "0"));
  svg.append(draw("text", { x: width - 4, y: height - 5, "text-anchor": "end" }, `searching for ${lasting(longest)}`));
  $("curve").replaceChildren(svg);
}

const digits = (value) => (Math.abs(value) >= 100 ? value.toFixed(0) : value.toPrecision(3));

export function showNext({ reason, options, state }) {
  const done = ["FOUND", "RETURNING", "DONE", "ABORTED"].includes(state);
  say($("reason"), done ? "nothing more to search" : reason);
  const shown = done ? [] : options.slice(0, 6);
  $("options").hidden = !shown.length;
  const rows = shown.map((option) => {
    const row = make("tr", { className: option.chosen ? "chosen" : "" });
    const weighed = option.value !== null && (option.visits || option.chosen);
    row.append(
      make("th", { scope: "row", textContent: option.words }),
      make("td", { className: "number", textContent: weighed ? option.visits : "–" }),
      make("td", { className: "number", textContent: weighed ? digits(option.value) : "–" }),
    );
    return row;
  });
  const body = $("options").tBodies[0];
  const html = rows.map((row) => row.outerHTML).join("");
  if (body.innerHTML !== html) body.replaceChildren(...rows);
}

/** Each fact: name, value, and how bad it is. */
function facts({ battery_percent, flight_left_s, flight_time_s, steps, mode, pose, link, detector, reports, outside, speedup }) {
  const unknown = ["unknown", ""];
  const battery = battery_percent === null ? unknown : [`${Math.round(battery_percent)} %`, battery_percent < 25 ? "bad" : ""];
  const left = flight_left_s === null ? unknown : ["about " + lasting(flight_left_s), flight_left_s < 180 ? "bad" : ""];
  let heard = unknown;
  if (link && !link.up) heard = [link.silent_s === null ? "not heard yet" : `silent for ${lasting(link.silent_s)}`, "bad"];
  else if (link) heard = [link.received === null ? "up" : `up, ${(100 * link.received).toFixed(0)} % received`, link.received !== null && link.received < 0.9 ? "doubtful" : ""];
  let looks = [`${reports.accepted} reports`, ""];
  if (detector?.silent) looks = [`silent for ${lasting(detector.silent_s)}`, "bad"];
  else if (detector && detector.silent_s !== null) looks = [`reporting, ${reports.accepted} so far`, ""];
  if (reports.refused) looks = [looks[0] + `, ${reports.refused} refused`, looks[1] || "doubtful"];
  const past = link === null; // a replay knows only what was written down
  return [
    ["battery", ...battery],
    ["time left", ...left],
    ["link", ...heard],
    ["detector", ...looks],
    ["mode", mode || "unknown", ""],
    ["height", pose ? `${Math.round(pose.height_m)} m` : "unknown", ""],
    ["in the air", `${lasting(flight_time_s)}, ${steps} cells`, ""],
    ["not in the area", percent(outside), ""],
    ...(speedup > 1 ? [["clock", `simulated, ${speedup} times faster`, "doubtful"]] : []),
  ].filter(([, value]) => !past || value !== "unknown");
}

export function showFacts(state) {
  const wanted = facts(state), list = $("facts");
  if (list.children.length !== 2 * wanted.length)
    list.replaceChildren(...wanted.flatMap(([name]) => [make("dt", { textContent: name }), make("dd")]));
  wanted.forEach(([name, value, how], i) => {
    say(list.children[2 * i], name);
    say(list.children[2 * i + 1], value);
    list.children[2 * i + 1].className = how;
  });
}

const line = (attributes) => [draw("line", { x1: 1, x2: 31, y1: 8, y2: 8, ...attributes })];
const KEYS = {
  regions: () => line({ stroke: "#5b2a91", "stroke-width": 2.5 }),
  track: () => line({ stroke: "#0d1620", "stroke-width": 2.5 }),
  footprint: () => [draw("rect", { x: 9, y: 1, width: 14, height: 14, fill: "#0b4aa2", "fill-opacity": 0.25, stroke: "#0b4aa2", "stroke-width": 2 })],
  ahead: () => line({ stroke: "#0b4aa2", "stroke-width": 4, "stroke-linecap": "round", "stroke-dasharray": "1 8" }),
  hits: () => [draw("circle", { cx: 16, cy: 8, r: 5, fill: "#d95f02" })],
  area: () => [draw("rect", { x: 2, y: 2, width: 12, height: 12, fill: "none", stroke: "#0d1620", "stroke-width": 2.5 }), draw("rect", { x: 19, y: 3, width: 10, height: 10, fill: "#b00020", "fill-opacity": 0.22, stroke: "#b00020", "stroke-width": 2, "stroke-dasharray": "4 2" })],
};

/** The layer switch, each layer with its key or legend. */
export function showLayers(chart) {
  const rows = [];
  for (const [key, name] of LAYERS) {
    if (!chart.layers[key]) continue;
    const box = make("input", { type: "checkbox", checked: !chart.hidden.has(key), id: "layer-" + key });
    box.addEventListener("change", () => chart.toggle(key, box.checked));
    const label = make("label", {}, box, make("span", { textContent: name }));
    if (KEYS[key]) {
      const svg = draw("svg", { class: "key", viewBox: "0 0 32 16", "aria-hidden": "true" });
      svg.append(...KEYS[key]());
      label.insertBefore(svg, label.lastChild);
    }
    const row = make("li", {}, label);
    if (key === "belief" || key === "pod") row.append(legend(key));
    rows.push(row);
  }
  $("layers").replaceChildren(...rows);
}

function legend(key) {
  const canvas = make("canvas", { className: "ramp" });
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", key === "belief" ? "Colours from improbable to probable" : "Colours from not looked at to well looked at");
  (key === "belief" ? heatRamp : podRamp)(canvas);
  const ticks = make("div", { className: "ticks", id: "ticks-" + key });
  if (key === "pod") ticks.append(...["POD 0 %", "50 %", "100 %"].map((text) => make("span", { textContent: text })));
  return make("div", { className: "legend" }, canvas, ticks);
}

/** The ends of the belief's scale, a cell. */
export function showScale(top) {
  const texts = heatTicks(top), ticks = $("ticks-belief");
  texts[0] = "≤ " + texts[0];
  texts[3] += " a cell";
  if (ticks && ticks.textContent !== texts.join("")) ticks.replaceChildren(...texts.map((text) => make("span", { textContent: text })));
}
