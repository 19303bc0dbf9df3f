// What is always there: the state in words, five things at a glance, and what happens next.

import { percent } from "./cells.js";
import { $, distance, lasting, make, say } from "./dom.js";

const SIDES = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];

/** Battery and the time that it leaves.
 * @param {RunState} state
 * @returns {string[]} as all of these: what it is, more of it, and how bad either is */
function battery({ battery_percent, battery_doubt, flight_left_s }) {
  const level = battery_percent === null ? "unknown" : `${Math.round(battery_percent)} %`;
  const left = flight_left_s === null ? "" : `${lasting(flight_left_s)} left`;
  const low = battery_percent !== null && battery_percent < 25;
  const short = flight_left_s !== null && flight_left_s < 180;
  return [level, left, battery_doubt || low ? "bad" : "", short ? "bad" : ""];
}

const SLOW_S = 2; // answers that take longer say that a position may be as old

/** Whether what the link carries is late.
 * @param {LinkState} link */
export const slow = (link) => (link.round_trip_s ?? 0) > SLOW_S;

/** @param {LinkState | null} link
 * @returns {string[]} */
function linked(link) {
  if (!link) return ["unknown", "", ""];
  if (!link.up) {
    const since = link.silent_s === null ? "not heard yet" : `for ${lasting(link.silent_s)}`;
    return ["lost", since, "bad"];
  }
  if (slow(link)) return ["slow", `answers after ${lasting(link.round_trip_s ?? 0)}`, "doubtful"];
  if (link.received === null) return ["good", "", ""];
  const weak = link.received < 0.9;
  return [weak ? "weak" : "good", `${(100 * link.received).toFixed(0)} %`, weak ? "doubtful" : ""];
}

/** @param {RunState} state
 * @returns {string[]} */
function detecting({ detector, reports }) {
  if (reports.refused_in_a_row >= 3) return ["refused", "see below", "bad"];
  if (reports.doubt) return ["doubtful", "see below", "bad"];
  if (detector?.silent) {
    return ["silent", lasting(/** @type {number} */ (detector.silent_s)), "bad"];
  }
  if (!detector) return ["unknown", "", ""];
  return detector.silent_s === null ? ["none yet", "", ""] : ["reporting", "", ""];
}

/** @param {WindState | null} wind
 * @returns {string[]} */
function blowing(wind) {
  if (!wind) return ["unknown", "", ""];
  if (wind.speed_mps < 0.5) return ["calm", "", ""];
  const side = SIDES[Math.round(wind.from_deg / 45) % 8];
  return [`${wind.speed_mps.toFixed(0)} m/s`, `from ${side}`, ""];
}

/** @param {number | null} metres
 * @returns {string[]} */
const height = (metres) => [
  metres === null ? "unknown" : `${Math.round(metres)} m`,
  metres === null ? "" : "above ground",
  "",
];

/** @param {RunState} state */
export function showStrip(state) {
  const over = state.state === "DONE" || state.state === "ABORTED"; // nothing is alarming any more
  const told = [
      battery(state),
      linked(state.link),
      detecting(state),
      height(state.height_above_ground_m),
      blowing(state.wind),
    ],
    strip = $("strip");
  told.forEach(([value, more, how, howMore = ""], i) => {
    const [, first, second] = strip.children[i].children;
    say(first, value);
    say(second, more || "\u00a0");
    first.className = over ? "" : how;
    second.className = over ? "more" : `more ${howMore}`;
  });
}

// There from the first moment on, so that the map below never moves.
$("strip").replaceChildren(
  ...["Battery", "Link", "Detector", "Height", "Wind"].map((name) =>
    make(
      "div",
      {},
      make("dt", { textContent: name }),
      make("dd", { textContent: "–" }),
      make("dd", { className: "more", textContent: "\u00a0" }),
    ),
  ),
);

/** What happens next, and what else could.
 * @param {RunState} state */
export function showNext(state) {
  say($("next"), state.next.words);
  const choice = !!state.next.name;
  const onItsWay = state.state === "SEARCHING" && choice; // why the search began is no news by then
  say($("why"), onItsWay ? "" : state.why || state.next.words);
  $("choices").hidden = !choice;
  const body = $("options").tBodies[0];
  const rows = state.choices.slice(0, 6).map(({ name, distance_m, probability, chosen }) =>
    make(
      "tr",
      { className: chosen ? "chosen" : "" },
      make("th", { scope: "row", textContent: name }),
      make("td", {
        className: "number",
        textContent: distance_m === null ? "–" : distance(distance_m),
      }),
      make("td", {
        className: "number",
        textContent: probability === null ? "–" : percent(probability),
      }),
    ),
  );
  const html = rows.map((row) => row.outerHTML).join("");
  if (body.innerHTML !== html) body.replaceChildren(...rows);
}
