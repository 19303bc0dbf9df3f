// Places in the team's own coordinates.

import { $, placeOf, say } from "./dom.js";
import { ask } from "./link.js";

const PAUSE_MS = 120;

/** How the team writes places. */
let coordinates = "degrees";
/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;

/** Write places as the team does from now on.
 * @param {string} how */
export function writeAs(how) {
  coordinates = how;
}

/** A place as the team writes it: grids are worked out by the service, which has the libraries for them.
 * @param {{ lat: number, lng: number }} at
 * @returns {Promise<string>} */
export async function inWords({ lat, lng }) {
  const degrees = placeOf({ lat, lon: lng });
  if (coordinates === "degrees") return degrees;
  try {
    return (await (await ask(`/api/written?lat=${lat}&lon=${lng}`)).json()).written;
  } catch {
    return degrees;
  }
}

/** Show the place under the cursor, or the one that was tapped, once it stays.
 * @param {{ lat: number, lng: number }} at */
export function showPlace(at) {
  clearTimeout(timer);
  const wait = coordinates === "degrees" ? 0 : PAUSE_MS;
  timer = setTimeout(async () => say($("cursor"), await inWords(at)), wait);
}
