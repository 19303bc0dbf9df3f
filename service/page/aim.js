// The map by keys: it moves under a cross-hair in its middle, and Enter is a click where that points.

import { strideOf } from "./crosshair.js";

/** Let the keyboard do on a map what a pointer does there. The cross-hair is shown while the map has the keyboard.
 * @param {any} map
 * @param {() => void} onMove is told when a key moves the map
 * @param {() => void} onEscape */
export function aimByKeys(map, onMove, onEscape) {
  const container = map.getContainer();
  const point = (/** @type {string} */ type) => map.fire(type, { latlng: map.getCenter() });
  const go = (/** @type {[number, number]} */ stride) => {
    onMove();
    map.panBy(stride, { animate: false });
    point("mousemove");
  };
  const escape = () => {
    onEscape();
    map.fire("escape");
  };
  /** @type {Record<string, () => void>} */
  const keys = { Enter: () => point("click"), " ": () => point("click"), Escape: escape };
  const key = (/** @type {any} */ event) => {
    if (event.target !== container) return;
    const stride = strideOf(event);
    const does = stride ? () => go(stride) : keys[event.key];
    if (!does) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    does();
  };
  // before the map library, whose arrow keys go further than a place wants
  container.addEventListener("keydown", key, { capture: true });
  container.addEventListener("focus", () => point("mousemove"));
  map.on("resize", () => document.activeElement === container && point("mousemove"));
  map.on("unload", () => container.removeEventListener("keydown", key, { capture: true }));
}
