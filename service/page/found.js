// The headline of a find: where, how sure, and how to hand it on.

import { certainty } from "./cells.js";
import { $, make, placeOf, say } from "./dom.js";
import { give, tell } from "./orders.js";
import { fill, frame } from "./pictures.js";

/** @typedef {{ place: any, sure: any, picture: any, geo: any, verdict: any }} Headline */

/** @type {Headline | null} */
let shown = null;
/** @type {FoundState | null} */
let now = null;

/** @param {RunState} state
 * @param {boolean} mayOrder
 * @param {(place: { lat: number, lon: number }) => void} onShow
 * @returns {boolean} whether it is news */
export function showFound(state, mayOrder, onShow) {
  const before = now;
  now = state.found;
  $("found").hidden = !now;
  if (!now) return false;
  shown ??= build(onShow);
  const place = placeOf(now);
  say(shown.place, place);
  say(shown.sure, described(now));
  fill(shown.picture, now.thumbnail, `what was found at ${place}`);
  shown.geo.href = `geo:${now.lat.toFixed(6)},${now.lon.toFixed(6)}`;
  shown.verdict.hidden = !mayOrder;
  for (const each of shown.verdict.children) {
    const label = `${each.textContent} ${place}`;
    if (each.ariaLabel !== label) each.ariaLabel = label;
  }
  shown.verdict.firstChild.disabled = now.confirmed;
  shown.verdict.lastChild.disabled = false;
  return !before;
}

/** Nobody hears a word now. */
export function stillFound() {
  for (const each of shown?.verdict.children ?? []) each.disabled = true;
}

/** @param {FoundState} found */
function described({ confirmed, probability, ellipse }) {
  const sure = confirmed ? "confirmed by a person" : `${certainty(probability)} sure`;
  return `${sure}, within ${Math.round(ellipse.semi_major_m)} m by ${Math.round(ellipse.semi_minor_m)} m`;
}

/** @param {(place: { lat: number, lon: number }) => void} onShow
 * @returns {Headline} */
function build(onShow) {
  const place = make("strong", { className: "coordinates" }),
    sure = make("p", { className: "sure" }),
    picture = frame("what was found"),
    geo = make("a", { className: "button", textContent: "Navigate" });
  const verdict = make(
    "div",
    { className: "verdict" },
    button("Confirm", () => now && give("confirm", now), "go"),
    button("Reject", () => now && give("reject", now)),
  );
  const share = button("Share", shareIt);
  share.hidden = !("share" in navigator);
  const hand = make(
    "div",
    { className: "hand" },
    button("Copy", copy),
    share,
    geo,
    button("Export", save),
    button("Show", () => now && onShow(now)),
  );
  const words = make(
    "div",
    { className: "said" },
    make("h2", { id: "found-title", textContent: "Found" }),
    place,
    sure,
  );
  $("found").replaceChildren(picture, words, hand, verdict);
  return { place, sure, picture, geo, verdict };
}

/** @param {string} text
 * @param {() => unknown} press */
function button(text, press, className = "") {
  const made = make("button", { type: "button", textContent: text, className });
  made.addEventListener("click", press);
  return made;
}

/** The place in words for whoever is told.
 * @param {FoundState} found */
function message(found) {
  const degrees = `${found.lat.toFixed(6)}, ${found.lon.toFixed(6)}`;
  const place = placeOf(found);
  return place === degrees ? `Found at ${degrees}` : `Found at ${place} (${degrees})`;
}

async function copy() {
  if (!now) return;
  const text = message(now);
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    selectAndCopy(text); // a page that came over plain http has no clipboard of its own
  }
  tell(`copied: ${text}`);
}

/** @param {string} text */
function selectAndCopy(text) {
  const field = make("textarea", { value: text, className: "hidden-field" });
  document.body.append(field);
  field.select();
  document.execCommand("copy");
  field.remove();
}

async function shareIt() {
  if (!now) return;
  try {
    await navigator.share({ title: "Found", text: message(now) });
  } catch (error) {
    if (/** @type {Error} */ (error).name !== "AbortError") {
      tell("sharing is not possible here; use Copy");
    }
  }
}

/** One waypoint as GPX 1.1, which handhelds and maps read. */
function save() {
  if (!now) return;
  const at = `lat="${now.lat.toFixed(7)}" lon="${now.lon.toFixed(7)}"`;
  const text = `<?xml version="1.0" encoding="UTF-8"?>
<gpx version="1.1" creator="roisearch" xmlns="http://www.topografix.com/GPX/1/1">
  <wpt ${at}><name>Found</name><desc>${described(now)}</desc></wpt>
</gpx>
`;
  const url = URL.createObjectURL(new Blob([text], { type: "application/gpx+xml" }));
  make("a", { href: url, download: "found.gpx" }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}
