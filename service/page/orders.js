// Orders: what moves the aircraft is asked twice, except to stop, which must not wait.

import { order } from "./link.js";
import { $, make, say } from "./panel.js";
import { percent } from "./cells.js";

const FLYING = ["SEARCHING", "CONFIRMING"];
const MAY = {
  hold: [...FLYING, "RETURNING"],
  resume: ["HOLDING", "YIELDED"],
  return: [...FLYING, "TAKEOFF", "HOLDING", "YIELDED"],
};
const QUESTIONS = {
  resume: ["Resume the search?", "The aircraft leaves its place and flies on with the search.", "Resume"],
  return: ["Return to launch?", "The search ends; the aircraft flies home and lands.", "Return"],
  confirm: ["Confirm the target?", "This is what was looked for: the search ends and the aircraft flies home.", "Confirm"],
  reject: ["Reject this detection?", "The map is lowered there, and the search goes on elsewhere. It cannot be taken back.", "Reject"],
};

let clearing;
export function tell(text) {
  clearTimeout(clearing);
  say($("toast"), text);
  clearing = setTimeout(() => say($("toast"), ""), 5000);
}

/** Ask; every question has a dialog of its own, since a closed dialog's "close" event may come late, after the next
 * question was opened, and must not answer that one. */
function sure(command) {
  const [title, text, yes] = QUESTIONS[command], dialog = $("ask").content.firstElementChild.cloneNode(true);
  dialog.querySelector("h2").textContent = title;
  dialog.querySelector("p").textContent = text;
  dialog.querySelector(".go").textContent = yes;
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((settle) => dialog.addEventListener("close", () => {
    dialog.remove();
    settle(dialog.returnValue === "yes");
  }));
}

export async function give(command, place = {}) {
  if (QUESTIONS[command] && !(await sure(command))) return;
  try {
    const { state } = await order({ command, ...place });
    tell(`${command}: ${state}`);
  } catch (error) {
    tell(`${command} failed: ${error.message}`);
  }
}

export function showOrders(state, mayOrder) {
  for (const button of $("orders").children) {
    const usable = mayOrder && (MAY[button.dataset.command] ?? []).includes(state);
    if (button.disabled === usable) button.disabled = !usable;
  }
}

for (const button of $("orders").children) button.addEventListener("click", () => give(button.dataset.command));

const key = ({ lat, lon }) => `${lat.toFixed(6)}, ${lon.toFixed(6)}`;

/** The detections that a person should judge; their list is rebuilt only when they are other ones. */
export function showSuspects(state, mayOrder, onShow) {
  const suspects = state.suspects ?? [], list = $("suspects"), card = $("suspects-card");
  card.hidden = !suspects.length && !state.found;
  say($("suspects-title"), state.found ? "Found" : "Detections");
  const wanted = JSON.stringify([suspects.map((each) => [key(each), each.thumbnail]), state.found, mayOrder]);
  if (list.dataset.shown !== wanted) {
    list.dataset.shown = wanted;
    list.replaceChildren(...(state.found ? [foundItem(state.found)] : suspects.map((each) => suspectItem(each, mayOrder, onShow))));
  }
  if (state.found) return;
  suspects.forEach((each, i) => {
    const hits = Array.isArray(each.hits) ? each.hits.length : each.hits;
    say(list.children[i].querySelector(".sure"), `${percent(each.probability)} sure${hits ? `, ${hits} ${hits === 1 ? "hit" : "hits"}` : ""}`);
  });
}

function foundItem(found) {
  const where = found.ellipse ? `, within ${Math.round(found.ellipse.semi_major_m)} m by ${Math.round(found.ellipse.semi_minor_m)} m` : "";
  return make("li", {}, make("strong", { textContent: key(found) }), make("span", { className: "where", textContent: `${(100 * found.probability).toFixed(1)} % sure${where}` }), ...(found.thumbnail ? [picture(found.thumbnail)] : []));
}

function suspectItem(each, mayOrder, onShow) {
  const item = make("li", {});
  item.append(make("strong", { className: "sure" }), make("span", { className: "where", textContent: key(each) }));
  const show = make("button", { type: "button", textContent: "Show" });
  show.addEventListener("click", () => onShow(each));
  const buttons = [show];
  if (mayOrder) {
    const confirm = make("button", { type: "button", textContent: "Confirm", className: "go" });
    confirm.addEventListener("click", () => give("confirm", { lat: each.lat, lon: each.lon }));
    const reject = make("button", { type: "button", textContent: "Reject" });
    reject.addEventListener("click", () => give("reject", { lat: each.lat, lon: each.lon }));
    buttons.push(confirm, reject);
  }
  if (each.thumbnail) item.append(picture(each.thumbnail));
  item.append(make("div", { className: "verdict" }, ...buttons));
  return item;
}

/** The address of the detector's picture: elsewhere, so only a click asks for it. */
function picture(address) {
  return make("a", { href: address, target: "_blank", rel: "noreferrer", textContent: "Picture" });
}
