// Orders: what moves the aircraft is asked twice, except to stop, which must not wait.

import { $, placeOf, say } from "./dom.js";
import { order } from "./link.js";

const FOR_ALL = ["hold", "finish"];
/** What is asked before: title, text, and the button that does it. @type {Record<string, string[]>} */
const QUESTIONS = {
  resume: [
    "Resume the search?",
    "The aircraft leaves its place and flies on with the search.",
    "Resume",
  ],
  launch: [
    "Take off?",
    "The aircraft, which stands on the ground, arms and climbs. Nobody may be near it.",
    "Launch",
  ],
  replace: [
    "Another aircraft?",
    "The search forgets the aircraft that landed, and takes the next that is heard on its link, or the one with " +
      "the system id that you give. Switch the old one off before.",
    "Replace",
  ],
  return: [
    "Return to launch?",
    "The aircraft flies home and lands. The search can go on with another battery.",
    "Return",
  ],
  finish: [
    "Finish the search?",
    "An aircraft of ours flies home and lands, and no further flight follows: the search is over.",
    "Finish",
  ],
  confirm: [
    "Confirm PLACE?",
    "This is what was looked for: the search ends and the aircraft flies home.",
    "Confirm",
  ],
  reject: [
    "Reject PLACE?",
    "The map is lowered there, and the search goes on elsewhere. It cannot be taken back.",
    "Reject",
  ],
};

/** @type {ReturnType<typeof setTimeout> | undefined} */
let clearing;
/** Say something for a few seconds.
 * @param {string} text */
export function tell(text) {
  clearTimeout(clearing);
  say($("toast"), text);
  clearing = setTimeout(() => say($("toast"), ""), 5000);
}

/** Ask; every question has a dialog of its own, since a closed dialog's "close" event may come late, after the next
 * question was opened, and must not answer that one.
 * @param {string} command
 * @param {string} place
 * @param {string} who the aircraft that is meant, where there are several
 * @returns {Promise<{ yes: boolean, system?: number }>} with the system id that was given, where one is asked for */
function sure(command, place, who) {
  const [title, text, yes] = QUESTIONS[command],
    dialog = $("ask").content.firstElementChild.cloneNode(true);
  dialog.querySelector("h2").textContent = who + title.replace("PLACE", place);
  dialog.querySelector("p").textContent = text;
  dialog.querySelector(".go").textContent = yes;
  const system = dialog.querySelector("[name=system]");
  system.parentElement.hidden = system.disabled = command !== "replace";
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((settle) =>
    dialog.addEventListener("close", () => {
      dialog.remove();
      settle({ yes: dialog.returnValue === "yes", system: Number(system.value) || undefined });
    }),
  );
}

/** What became of an order, for people. @type {Record<string, string>} */
const DONE = {
  hold: "It holds still",
  resume: "The search goes on",
  return: "It flies home",
  launch: "It takes off",
  replace: "Waiting for another aircraft",
  finish: "The search is finished",
  confirm: "Confirmed",
  reject: "Rejected",
};

/** Give an order, after a question where it has one.
 * @param {string} command
 * @param {{ written?: string, lat: number, lon: number } | null} place what it is about, if it is about one
 * @param {string} [aircraft] the one that is meant; else all of them, or the only one */
export async function give(command, place = null, aircraft = undefined) {
  const where = place ? placeOf(place) : "",
    who = aircraft === undefined ? "" : `Aircraft ${aircraft}: `;
  const { lat, lon } = place ?? {}; // as it was when the button was pressed
  const { yes, system } = QUESTIONS[command] ? await sure(command, where, who) : { yes: true };
  if (!yes) return;
  try {
    const { refused } = await order({ command, lat, lon, aircraft, system_id: system });
    const which = system === undefined ? "" : `, of system ${system}`;
    const done = `${DONE[command] ?? command}${which}${where && ": "}${where}`;
    tell(who + (refused ? `${command} is refused: ${refused}` : done));
  } catch (error) {
    tell(`${who}${command} failed: ${/** @type {Error} */ (error).message}`);
  }
}

/** The buttons, of which only those that would change something now can be pressed. Of several aircraft each has its
 * own; then here are those for all of them, and the one that holds them all can always be pressed.
 * @param {string[][]} orders of all aircraft
 * @param {boolean} mayOrder */
export function showOrders(orders, mayOrder) {
  const all = orders.length > 1;
  for (const button of $("orders").children) {
    const { command } = button.dataset;
    const sensible = orders.some((each) => each.includes(command));
    const usable = mayOrder && (sensible || (all && command === "hold"));
    if (button.disabled === usable) button.disabled = !usable;
    if (!orders.length) continue; // there is nothing new to say
    button.hidden = all && !FOR_ALL.includes(command);
    if (command === "hold") say(button, all ? "Hold all" : "Hold");
  }
}

for (const button of $("orders").children) {
  button.addEventListener("click", () => give(button.dataset.command));
}
