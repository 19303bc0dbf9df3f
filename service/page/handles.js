// What can be dragged on the map can be moved by arrow keys too: pins, corners, and the middles between corners.

import { announce, strideOf } from "./crosshair.js";
import { inWords } from "./cursor.js";

const L = window.L;

/** The marker of an element.
 * @param {any} map
 * @param {EventTarget | null} element
 * @returns {any} */
function markerOf(map, element) {
  let found = null;
  map.eachLayer((/** @type {any} */ layer) => {
    if (layer instanceof L.Marker && layer.getElement() === element) found = layer;
  });
  return found;
}

/** Move it as a drag does: whoever listens to that needs to know of no keys.
 * @param {any} map
 * @param {any} marker
 * @param {[number, number]} stride */
function move(map, marker, stride) {
  const before = map.latLngToContainerPoint(marker.getLatLng());
  marker.fire("dragstart");
  marker.setLatLng(map.containerPointToLatLng(before.add(stride)));
  marker.fire("dragend");
  if (!map.hasLayer(marker)) {
    map.getContainer().focus();
    return announce("It stays where it was: the border would cross itself.");
  }
  if (!map.getBounds().contains(marker.getLatLng())) {
    map.panTo(marker.getLatLng(), { animate: false });
  }
  return tellPlace(marker);
}

/** Say where it is now, unless it has moved on meanwhile.
 * @param {any} marker */
async function tellPlace(marker) {
  const at = marker.getLatLng();
  const words = await inWords(at);
  if (marker.getLatLng().equals(at)) announce(`Moved to ${words}`);
}

/** Make a corner of the middle of a side.
 * @param {any} marker */
function split(marker) {
  marker.fire("click");
  marker.getElement()?.focus(); // a corner looks otherwise, and is another element
  announce("Corner made; arrow keys move it.");
}

/** Take a corner away, as the drawing plugin does with the other button of a mouse.
 * @param {any} map
 * @param {any} marker */
function remove(map, marker) {
  marker.fire("contextmenu");
  const gone = !map.hasLayer(marker);
  if (gone) map.getContainer().focus();
  announce(gone ? "Corner removed." : "Ground needs three corners, a line two.");
}

/** The plugin's handles are buttons without names; each gets one.
 * @param {any} pane
 * @param {(kind: string) => string} titleOf */
function nameAll(pane, titleOf) {
  for (const handle of pane.children) {
    const pin = handle.querySelector("[data-kind]");
    const middle = handle.classList.contains("marker-icon-middle");
    const corner = middle
      ? "middle of a side; Enter makes it a corner"
      : "corner; arrow keys move it, Delete removes it";
    const name = pin ? `${titleOf(pin.dataset.kind)}; arrow keys move it` : corner;
    if (handle.ariaLabel !== name) handle.ariaLabel = name;
  }
}

/** What a key does to a marker.
 * @param {any} map
 * @param {any} event
 * @returns {((marker: any) => void) | null} */
function doing(map, event) {
  const stride = strideOf(event),
    { classList } = event.target;
  if (stride) return (marker) => move(map, marker, stride);
  if (event.key === "Enter" && classList.contains("marker-icon-middle")) return split;
  if (event.key === "Delete" && classList.contains("marker-icon")) {
    return (marker) => remove(map, marker);
  }
  return null;
}

/** Let keys move what is on a map.
 * @param {any} map
 * @param {(kind: string) => string} titleOf */
export function placeHandles(map, titleOf) {
  const pane = map.getPane("markerPane");
  new MutationObserver(() => nameAll(pane, titleOf)).observe(pane, { childList: true });
  pane.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const does = doing(map, event);
    if (!does) return;
    const marker = markerOf(map, event.target);
    if (!marker) return;
    event.preventDefault();
    event.stopPropagation();
    does(marker);
  });
}
