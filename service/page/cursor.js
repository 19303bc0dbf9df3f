// The place under the cursor in the team's own coordinates.

import { $, placeOf, say } from "./dom.js";
import { ask } from "./link.js";

const PAUSE_MS = 120;

/** The place under the cursor, or the one that was tapped. */
export class Cursor {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  timer;

  /** @param {string} coordinates how the team writes places */
  constructor(coordinates) {
    this.coordinates = coordinates;
  }

  /** @param {{ lat: number, lng: number }} at */
  show({ lat, lng }) {
    const degrees = placeOf({ lat, lon: lng });
    clearTimeout(this.timer);
    if (this.coordinates === "degrees") return void say($("cursor"), degrees);
    this.timer = setTimeout(
      async () => say($("cursor"), await this.write(lat, lng, degrees)),
      PAUSE_MS,
    );
  }

  /** Grids are worked out by the service, which has the libraries for them.
   * @param {number} lat
   * @param {number} lon
   * @param {string} otherwise
   * @returns {Promise<string>} */
  async write(lat, lon, otherwise) {
    try {
      return (await (await ask(`/api/written?lat=${lat}&lon=${lon}`)).json()).written;
    } catch {
      return otherwise;
    }
  }
}
