// Cards for what was seen, in the order in which it was seen first: no card moves under a finger.

import { certainty } from "./cells.js";
import { $, make, metresBetween, placeOf, say } from "./dom.js";
import { give } from "./orders.js";
import { fill, frame } from "./pictures.js";

const STAYS_MS = 4000; // a card of what is no longer likely

/** @typedef {object} Card
 * @property {SuspectState} now
 * @property {any} item
 * @property {any} where
 * @property {any} told
 * @property {any} picture
 * @property {any[]} buttons
 * @property {number | null} gone when it was last likely */

/** @type {Card[]} */
const cards = [];
let touched = 0;

for (const kind of ["pointerdown", "pointermove", "focusin", "keydown"]) {
  $("suspects").addEventListener(kind, () => (touched = Date.now()));
}

/** Whether somebody's finger, pointer or keyboard is at the list.
 * @returns {boolean} */
const busy = () =>
  $("suspects").matches(":hover") ||
  $("suspects").querySelector(":focus:enabled") !== null ||
  Date.now() - touched < STAYS_MS;

/** Show the detections that a person should judge.
 * @param {RunState} state
 * @param {boolean} mayOrder
 * @param {number} near_m how far the place of one may move and still be the same
 * @param {(place: { lat: number, lon: number }) => void} onShow
 * @returns {SuspectState[]} those that are new */
export function showSuspects(state, mayOrder, near_m, onShow) {
  const found = state.found;
  const left = state.suspects.filter((each) => !found || metresBetween(each, found) > near_m);
  for (const card of cards) {
    const at = closest(left, card.now, near_m);
    if (at === null) leave(card, found && metresBetween(card.now, found) <= near_m);
    else update(card, left.splice(at, 1)[0], mayOrder);
  }
  const fresh = left.map((suspect) => {
    const card = makeCard(suspect, onShow);
    cards.push(card);
    $("suspects").append(card.item);
    update(card, suspect, mayOrder);
    return suspect;
  });
  if (!busy()) clear();
  $("suspects-none").hidden = cards.length > 0;
  showCount(cards.filter(({ gone }) => gone === null).length);
  return fresh;
}

/** How many wait, said on the map too where the list lies below it.
 * @param {number} waiting */
function showCount(waiting) {
  const said = `${waiting} detection${waiting === 1 ? "" : "s"} to look at`;
  say($("suspects-title"), waiting ? said : "Detections");
  if (waiting) say($("to-look-at"), said);
  $("to-look-at").hidden = !waiting;
}

export const goToSuspects = () => $("suspects-card").scrollIntoView({ block: "nearest" });
$("to-look-at").addEventListener("click", goToSuspects);

/** Which of some places is the same as another.
 * @param {SuspectState[]} places
 * @param {SuspectState} known
 * @param {number} near_m */
function closest(places, known, near_m) {
  let [best, least] = [/** @type {number | null} */ (null), near_m];
  places.forEach((each, i) => {
    const away = metresBetween(each, known);
    if (away <= least) [best, least] = [i, away];
  });
  return best;
}

/** @param {SuspectState} first
 * @param {(place: { lat: number, lon: number }) => void} onShow
 * @returns {Card} */
function makeCard(first, onShow) {
  const where = make("strong", { className: "where" }),
    told = make("span", { className: "sure" }),
    picture = frame("what the detector saw");
  const show = make("button", { type: "button", textContent: "Show" }),
    confirm = make("button", { type: "button", textContent: "Confirm", className: "go" }),
    reject = make("button", { type: "button", textContent: "Reject" });
  const item = make(
    "li",
    {},
    picture,
    make("div", { className: "said" }, where, told),
    make("div", { className: "verdict" }, show, confirm, reject),
  );
  const card = {
    now: first,
    item,
    where,
    told,
    picture,
    buttons: [show, confirm, reject],
    gone: null,
  };
  show.addEventListener("click", () => onShow(card.now));
  confirm.addEventListener("click", () => give("confirm", card.now));
  reject.addEventListener("click", () => give("reject", card.now));
  return card;
}

/** @param {Card} card
 * @param {SuspectState} suspect
 * @param {boolean} mayOrder */
function update(card, suspect, mayOrder) {
  card.now = suspect;
  card.gone = null;
  card.item.classList.remove("gone");
  const place = placeOf(suspect);
  say(card.where, place);
  say(card.told, described(suspect));
  fill(card.picture, suspect.thumbnail, `what was seen at ${place}`);
  const [show, confirm, reject] = card.buttons;
  for (const button of card.buttons) {
    button.disabled = false;
    const label = `${button.textContent} ${place}`;
    if (button.ariaLabel !== label) button.ariaLabel = label;
  }
  show.hidden = false;
  confirm.hidden = reject.hidden = !mayOrder;
}

/** What is known of it, in words.
 * @param {SuspectState} suspect */
function described({ probability, score, hits }) {
  const seen = hits === 1 ? "seen once" : hits ? `seen ${hits} times` : "seen";
  const scored = score === null ? "" : `, score ${score.toFixed(2)}`;
  return `${certainty(probability)} sure${scored}, ${seen}`;
}

/** It is the find now, or no longer likely, or was judged: its card stays where it is for a while, and can no longer
 * be pressed.
 * @param {Card} card
 * @param {boolean | null} isFind */
function leave(card, isFind) {
  say(card.told, isFind ? "this is the find" : "no longer likely");
  if (card.gone !== null) return;
  card.gone = Date.now();
  card.item.classList.add("gone");
  for (const button of card.buttons) button.disabled = true;
}

function clear() {
  const now = Date.now();
  for (let i = cards.length - 1; i >= 0; i--) {
    const { gone, item } = cards[i];
    if (gone !== null && now - gone > STAYS_MS) {
      item.remove();
      cards.splice(i, 1);
    }
  }
}

/** Nobody hears a word now: nothing can be judged until something is told again. */
export function stillSuspects() {
  for (const { buttons } of cards) for (const button of buttons.slice(1)) button.disabled = true;
}

/** Another time of a replay is another story: nothing of this one stays. */
export function forgetSuspects() {
  cards.length = 0;
  $("suspects").replaceChildren();
}
