// Several aircraft: a panel for each, with orders of its own. A search with one aircraft has none of this.

import { $, make, say } from "./dom.js";
import { give } from "./orders.js";

export const FINAL = ["DONE", "ABORTED"];
const ORDERS = ["hold", "resume", "return", "launch", "replace"];
export const COLOURS = 8; // that style.css has

/** @param {RunState} state */
export const several = (state) => (state.aircraft ?? []).length > 1;

/** A panel's parts, which stay where they are while what they say changes.
 * @typedef {object} Panel
 * @property {any} whole
 * @property {any} chip
 * @property {any} next
 * @property {any} why
 * @property {any[]} facts
 * @property {any[]} buttons */

/** By name. @type {Map<string, Panel>} */
const panels = new Map();

/** @param {AircraftState} craft
 * @returns {Panel} */
function made({ name, colour }) {
  const chip = make("span", { className: "chip" }),
    next = make("p", { className: "small" }),
    why = make("p", { className: "small" }),
    facts = ["Battery", "Height", "Link"].map((title) =>
      make("div", {}, make("dt", { textContent: title }), make("dd")),
    );
  const buttons = ORDERS.map((command) => {
    const word = command[0].toUpperCase() + command.slice(1);
    const button = make("button", { type: "button", textContent: word, disabled: true });
    button.className = command === "hold" ? "order stop" : "order";
    button.setAttribute("aria-label", `${word} aircraft ${name}`);
    button.addEventListener("click", () => give(command, null, name));
    return button;
  });
  const title = make("h3", {}, make("span", { className: "swatch" }), `Aircraft ${name} `, chip);
  const group = make("div", { className: "buttons" }, ...buttons);
  const whole = make("li", {}, title, next, why, make("dl", {}, ...facts), group);
  whole.dataset.colour = String(colour % COLOURS);
  return { whole, chip, next, why, facts: facts.map((fact) => fact.lastChild), buttons };
}

/** What is told of its link, and how bad that is.
 * @param {LinkState | null} link */
function linked(link) {
  if (!link) return ["unknown", ""];
  return link.up ? ["good", ""] : ["lost", "bad"];
}

/** @param {AircraftState} craft
 * @returns {string[][]} */
const told = ({ battery, height, link }) => [
  [
    battery === null ? "unknown" : `${Math.round(battery)} %`,
    battery !== null && battery < 25 ? "bad" : "",
  ],
  [height === null ? "unknown" : `${Math.round(height)} m`, ""],
  linked(link),
];

/** @param {Panel} panel
 * @param {AircraftState} craft
 * @param {boolean} mayOrder */
function fill(panel, craft, mayOrder) {
  say(panel.chip, craft.words);
  panel.chip.dataset.state = craft.state;
  say(panel.next, FINAL.includes(craft.state) ? "This aircraft flies no more" : craft.next.words);
  say(panel.why, craft.state === "SEARCHING" ? "" : craft.why);
  told(craft).forEach(([value, how], i) => {
    say(panel.facts[i], value);
    panel.facts[i].className = how;
  });
  panel.buttons.forEach((button, i) => {
    button.parentElement.hidden = !mayOrder;
    button.disabled = !mayOrder || !craft.orders.includes(ORDERS[i]);
  });
}

/** Show a panel for each aircraft, when there are several.
 * @param {RunState} state
 * @param {boolean} mayOrder */
export function showFleet(state, mayOrder) {
  const fleet = several(state) ? state.aircraft : [];
  $("fleet-card").hidden = !fleet.length;
  const names = fleet.map(({ name }) => name);
  if (names.join("\n") !== [...panels.keys()].join("\n")) {
    panels.clear();
    for (const craft of fleet) panels.set(craft.name, made(craft));
    $("fleet").replaceChildren(...[...panels.values()].map(({ whole }) => whole));
  }
  for (const craft of fleet) fill(/** @type {Panel} */ (panels.get(craft.name)), craft, mayOrder);
}

/** Nothing can be ordered until something is heard again. */
export function stillFleet() {
  for (const { buttons } of panels.values()) for (const button of buttons) button.disabled = true;
}
