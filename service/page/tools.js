// Tools on the map: fit, follow, measure, and the place under the cursor in the team's own coordinates.

import { aimByKeys } from "./aim.js";
import { showPlace, writeAs } from "./cursor.js";
import { $, say } from "./dom.js";

/** @import { Chart } from "./map.js" */

const L = window.L;

const CLEAR_PX = 30; // the star of a find, and a little
/** What is said while no place is pointed at. */
const IDLE = matchMedia("(pointer: coarse)").matches ? "tap for a place" : "–";

/** @param {string} id
 * @param {boolean} pressed */
const press = (id, pressed) => $(id).setAttribute("aria-pressed", String(pressed));

/** @param {string} id */
const pressed = (id) => $(id).getAttribute("aria-pressed") === "true";

/** A line that is measured, from click to click. */
class Tape {
  /** @param {any} map */
  constructor(map) {
    this.map = map;
    /** @type {any[]} */
    this.points = [];
    this.line = L.polyline([], { className: "tape", weight: 3, interactive: false });
  }

  /** @param {any} at */
  add(at) {
    this.points.push(at);
    this.line.setLatLngs(this.points).addTo(this.map);
    const metres = this.points
      .slice(1)
      .reduce((sum, point, i) => sum + this.map.distance(this.points[i], point), 0);
    const text = metres < 1000 ? `${metres.toFixed(0)} m` : `${(metres / 1000).toFixed(2)} km`;
    this.line.unbindTooltip();
    this.line.bindTooltip(text, { permanent: true, direction: "right", className: "measured" });
    this.line.openTooltip(at);
    say(
      $("cursor"),
      this.points.length > 1 ? `measured: ${text}` : "click the next point, or Enter",
    );
  }

  clear() {
    this.points = [];
    this.line.remove();
  }
}

/** @type {Chart | null} */
let chart = null;
/** @type {Tape | null} */
let tape = null;

const look = () => press("follow", false);

/** Begin to measure, or end it. */
function measure() {
  press("measure", !pressed("measure"));
  tape?.clear();
  say($("cursor"), pressed("measure") ? "click the first point, or Enter" : IDLE);
}

/** Let the tools work on a map.
 * @param {Chart} on
 * @param {string} coordinates */
export function placeTools(on, coordinates) {
  chart = on;
  writeAs(coordinates);
  tape = new Tape(on.map);
  on.map.on("mousemove click", (/** @type {any} */ { latlng, type }) => {
    if (!pressed("measure")) showPlace(latlng);
    else if (type === "click") tape?.add(latlng);
  });
  on.map.on("dragstart", look); // a hand on the map wants to look elsewhere
  aimByKeys(on.map, look, () => {
    if (!pressed("measure")) return;
    measure();
    $("measure").focus();
  });
  $(`view-${on.shows}`).checked = true;
}

/** Keep the aircraft in the middle while that is wanted.
 * @param {RunState} state */
export function follow({ pose }) {
  if (pose && chart && pressed("follow")) {
    chart.map.panTo([pose.lat, pose.lon], { animate: false });
  }
}

/** Move the map down where something over its top hides a place.
 * @param {{ lat: number, lon: number }} place
 * @param {HTMLElement} over */
export function uncover({ lat, lon }, over) {
  if (!chart) return;
  const map = chart.map.getContainer().getBoundingClientRect(),
    hides = over.getBoundingClientRect(),
    { x, y } = chart.map.latLngToContainerPoint([lat, lon]);
  const beside = Math.abs(map.x + x - (hides.x + hides.width / 2)) - hides.width / 2;
  const up = hides.bottom + CLEAR_PX - (map.y + y);
  if (beside < CLEAR_PX && up > 0) chart.map.panBy([0, -up], { animate: false });
}

say($("cursor"), IDLE);
$("fit").addEventListener("click", () => {
  press("follow", false);
  chart?.fit();
});
$("follow").addEventListener("click", () => press("follow", !pressed("follow")));
$("measure").addEventListener("click", (/** @type {MouseEvent} */ { detail }) => {
  measure();
  if (!detail && pressed("measure")) $("map").focus(); // pressed by a key: the map has the keyboard now
});
$("views").addEventListener("change", (/** @type {any} */ { target }) => chart?.show(target.value));
