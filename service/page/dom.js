// Small helps: parts of the page, new elements, words for people.

const SVG = "http://www.w3.org/2000/svg";

/** A part of the page: whatever element has this id. It is a mistake of ours when there is none.
 * @param {string} id
 * @returns {any} */
export function $(id) {
  const part = document.getElementById(id);
  if (!part) throw new Error(`the page has no part '${id}'`);
  return part;
}

/** An element with properties and children.
 * @param {string} tag
 * @param {Record<string, unknown>} properties
 * @param {(Node | string)[]} children
 * @returns {any} */
export function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** An element of a drawing.
 * @param {string} tag
 * @param {Record<string, string | number>} attributes
 * @param {string} [text] */
export function draw(tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  if (text !== undefined) element.textContent = text;
  return element;
}

/** Write only what is new: a screen reader is told of every change.
 * @param {Element} element
 * @param {string} text */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Seconds for people.
 * @param {number} seconds */
export function lasting(seconds) {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h ${Math.round((seconds % 3600) / 60)} min`;
}

/** Metres for people.
 * @param {number} metres */
export function distance(metres) {
  if (metres < 10) return "here";
  return metres < 995 ? `${Math.round(metres / 10) * 10} m` : `${(metres / 1000).toFixed(1)} km`;
}

/** Metres between two places; flat, which is enough for a search.
 * @param {{ lat: number, lon: number }} one
 * @param {{ lat: number, lon: number }} other */
export function metresBetween(one, other) {
  const degree = 111195,
    narrow = Math.cos((one.lat * Math.PI) / 180);
  return degree * Math.hypot(one.lat - other.lat, (one.lon - other.lon) * narrow);
}

/** A place as the team writes it.
 * @param {{ written?: string, lat: number, lon: number }} place */
export const placeOf = ({ written, lat, lon }) => written ?? `${lat.toFixed(6)}, ${lon.toFixed(6)}`;

/** What this browser remembers under a name, or what else is said; a browser may forbid it.
 * @param {string} name
 * @param {string} otherwise */
export function remembered(name, otherwise) {
  try {
    return localStorage.getItem(name) ?? otherwise;
  } catch {
    return otherwise;
  }
}

/** @param {string} name
 * @param {string} value */
export function remember(name, value) {
  try {
    localStorage.setItem(name, value);
  } catch {
    // a private window keeps nothing, and the page works all the same
  }
}
