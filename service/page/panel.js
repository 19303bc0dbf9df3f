// The numbers beside the map.

import { percent, tenths } from "./cells.js";
import { $, draw, lasting, make, say } from "./dom.js";
import { slow } from "./strip.js";

/** @import { Run } from "./run.js" */

/** @param {Run} run */
export function showPos(run) {
  const { state } = run;
  say($("pos"), tenths(state.pos));
  const estimate = state.estimate;
  const wanted = (estimate?.goals ?? []).map(({ pos, reached, seconds }) => [
    `to ${Math.round(100 * pos)} %`,
    reached
      ? "reached"
      : seconds !== null
        ? "in " + lasting(seconds)
        : /** @type {EstimateState} */ (estimate).reachable < pos
          ? "out of reach"
          : "later",
  ]);
  const kept = $("goals").children;
  if (kept.length !== wanted.length) {
    $("goals").replaceChildren(...wanted.map(() => make("div", {}, make("dt"), make("dd"))));
  }
  wanted.forEach(([name, value], i) => {
    say(kept[i].firstChild, name);
    say(kept[i].lastChild, value);
  });
  const left = state.flight_left_s;
  const over = estimate?.goals.find(
    (goal) => !goal.reached && goal.seconds !== null && left !== null && goal.seconds > left,
  );
  const limit =
    estimate && estimate.reachable < 0.95
      ? ` At most ${percent(estimate.reachable)} can be reached: the rest lies outside the area or where the drone may not fly.`
      : "";
  say(
    $("basis"),
    estimate
      ? `An estimate, if the search goes on and nothing is reported.${limit}${over ? ` The battery ends before ${Math.round(100 * over.pos)} %.` : ""}`
      : "",
  );
}

/** @param {Run} run */
export function showCurve(run) {
  const points = run.curve,
    { state } = run;
  const width = 340,
    height = 130,
    left = 42,
    bottom = 20,
    top = 6;
  const longest = Math.max(60, points.at(-1)?.[0] ?? 0);
  const x = (/** @type {number} */ seconds) => left + ((width - left - 4) * seconds) / longest;
  const y = (/** @type {number} */ pos) => top + (height - top - bottom) * (1 - pos);
  const svg = draw("svg", {
    viewBox: `0 0 ${width} ${height}`,
    role: "img",
    "aria-label": `Probability of success over time: ${percent(state.pos)} after ${lasting(longest)}`,
  });
  for (const pos of [0, 0.25, 0.5, 0.75, 1]) {
    svg.append(
      draw("line", {
        x1: left,
        x2: width - 4,
        y1: y(pos),
        y2: y(pos),
        class: "rule",
      }),
    );
    if (pos !== 0.25 && pos !== 0.75) {
      svg.append(
        draw("text", { x: left - 4, y: y(pos) + 4, "text-anchor": "end" }, `${100 * pos} %`),
      );
    }
  }
  const shown = [...points, [longest, points.at(-1)?.[1] ?? 0]];
  const path = shown
    .map(([s, p], i) => `${i ? "L" : "M"}${x(s).toFixed(1)} ${y(p).toFixed(1)}`)
    .join("");
  svg.append(
    draw("path", {
      d: `${path}L${x(longest)} ${y(0)}L${x(0)} ${y(0)}Z`,
      class: "under",
    }),
  );
  svg.append(
    draw("path", {
      d: path,
      class: "over",
    }),
  );
  svg.append(draw("text", { x: left, y: height - 5 }, "0"));
  svg.append(
    draw(
      "text",
      { x: width - 4, y: height - 5, "text-anchor": "end" },
      `searching for ${lasting(longest)}`,
    ),
  );
  $("curve").replaceChildren(svg);
}

const unknown = ["unknown", ""];

/** Whether the autopilot is heard, and how bad it is.
 * @param {LinkState | null} link */
function heard(link) {
  if (!link) return unknown;
  if (!link.up) {
    const silent =
      link.silent_s === null ? "not heard yet" : `silent for ${lasting(link.silent_s)}`;
    return [silent, "bad"];
  }
  if (slow(link)) return [`up, answers after ${lasting(link.round_trip_s ?? 0)}`, "doubtful"];
  if (link.received === null) return ["up", ""];
  const received = `up, ${(100 * link.received).toFixed(0)} % received`;
  return [received, link.received < 0.9 ? "doubtful" : ""];
}

/** What the detector does, and how bad it is.
 * @param {DetectorState | null} detector
 * @param {ReportsState} reports */
function looks(detector, reports) {
  if (reports.refused_in_a_row >= 3) return [`reports are refused: ${reports.last_refusal}`, "bad"];
  if (reports.doubt) return [reports.doubt, "bad"];
  let [said, how] = [`${reports.accepted} reports`, ""];
  if (detector?.silent) {
    [said, how] = [`silent for ${lasting(/** @type {number} */ (detector.silent_s))}`, "bad"];
  } else if (detector && detector.silent_s !== null) said = `reporting, ${reports.accepted} so far`;
  return reports.refused ? [`${said}, ${reports.refused} refused`, how || "doubtful"] : [said, how];
}

/** Which aircraft flew a flight, where it was not the same for all of them.
 * @param {SortieState} sortie
 * @param {SortieState[]} all */
function flownBy({ system_id, autopilot }, all) {
  const flyers = new Set(all.map((each) => `${each.system_id} ${each.autopilot}`));
  return flyers.size > 1 && system_id !== null ? `, by system ${system_id} (${autopilot})` : "";
}

/** Where nothing is seen from the air, the most likely first.
 * @param {PlaceState[]} unseen */
function places(unseen) {
  const likely = [...unseen].sort((a, b) => b.probability - a.probability).slice(0, 3);
  const told = likely.map((each) => `${each.written} (${percent(each.probability)})`).join("; ");
  const more = unseen.length - likely.length;
  return more ? `${told}; and ${more} more` : told;
}

/** What is measured of the battery: volts, amperes, and what was used.
 * @param {RunState["battery"]} cells
 * @returns {string} */
function measured(cells) {
  const told = [
    cells?.voltage_v != null ? `${cells.voltage_v.toFixed(1)} V` : "",
    cells?.current_a != null ? `${cells.current_a.toFixed(1)} A` : "",
    cells?.consumed_mah != null ? `${Math.round(cells.consumed_mah)} mAh used` : "",
  ];
  return told.filter(Boolean).join(", ");
}

/** Each fact: name, value, and how bad it is.
 * @param {RunState} state
 * @returns {string[][]} */
function facts({
  battery_percent,
  battery_doubt,
  battery: cells,
  flight_left_s,
  flight_time_s,
  sorties,
  mode,
  pose,
  link,
  detector,
  reports,
  outside,
  drawn,
  unseen,
  speedup,
}) {
  const battery = battery_doubt
    ? [battery_doubt, "bad"]
    : battery_percent === null
      ? unknown
      : [`${Math.round(battery_percent)} %`, battery_percent < 25 ? "bad" : ""];
  const left =
    flight_left_s === null
      ? unknown
      : ["about " + lasting(flight_left_s), flight_left_s < 180 ? "bad" : ""];
  const past = link === null; // a replay knows only what was written down
  return [
    ["battery", ...battery],
    ...(measured(cells) ? [["voltage, current", measured(cells), ""]] : []),
    ["time left", ...left],
    ["link", ...heard(link)],
    ["detector", ...looks(detector, reports)],
    ["autopilot mode", mode || "unknown", ""],
    ["above launch", pose ? `${Math.round(pose.height_m)} m` : "unknown", ""],
    ["place", pose ? pose.written : "unknown", ""],
    ["in the air", lasting(flight_time_s), ""],
    ...(sorties ?? []).map((each) => [
      `flight ${each.number}`,
      `${lasting(each.flight_time_s)}, then ${percent(each.pos)} searched${flownBy(each, sorties)}`,
      "",
    ]),
    ["not in the area", percent(outside), ""],
    ...(drawn?.words ? [["likely places", drawn.words, ""]] : []),
    ...(unseen.length ? [["needs a ground team", places(unseen), "bad"]] : []),
    ...(speedup > 1 ? [["clock", `simulated, ${speedup} times faster`, "doubtful"]] : []),
  ].filter(([, value]) => !past || value !== "unknown");
}

/** @param {RunState} state */
export function showFacts(state) {
  const wanted = facts(state),
    list = $("facts");
  if (list.children.length !== 2 * wanted.length) {
    list.replaceChildren(
      ...wanted.flatMap(([name]) => [make("dt", { textContent: name }), make("dd")]),
    );
  }
  wanted.forEach(([name, value, how], i) => {
    say(list.children[2 * i], name);
    say(list.children[2 * i + 1], value);
    list.children[2 * i + 1].className = how;
  });
}
