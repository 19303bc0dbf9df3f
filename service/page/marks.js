// What is drawn at a point of the map.

const L = window.L;

export const CRAFT = `<svg width="36" height="36" viewBox="-18 -18 36 36" aria-hidden="true"><g><path d="M0-15 11 12 0 6-11 12Z" fill="#0b4aa2" stroke="#fff" stroke-width="2.5" stroke-linejoin="round"/></g></svg>`;
export const LAUNCH = `<svg width="26" height="26" viewBox="-13 -13 26 26" aria-hidden="true"><circle r="11" fill="#fff" stroke="#0d1620" stroke-width="2.5"/><path d="M-4-6V6M4-6V6M-4 0H4" stroke="#0d1620" stroke-width="2.6"/></svg>`;
export const FOUND = `<svg width="44" height="44" viewBox="-22 -22 44 44" aria-hidden="true"><path d="M0-18 5-6 18-5 8 3 11 16 0 9-11 16-8 3-18-5-5-6Z" fill="#ffd400" stroke="#0d1620" stroke-width="2.5" stroke-linejoin="round"/></svg>`;
export const SUSPECT = `<svg width="40" height="40" viewBox="-20 -20 40 40" aria-hidden="true"><circle r="16" fill="#b00020" stroke="#fff" stroke-width="3"/><path d="M0-9V3M0 8V9" stroke="#fff" stroke-width="4" stroke-linecap="round"/></svg>`;

/**
 * @param {string} html
 * @param {number} size */
export const icon = (html, size, name = "") =>
  L.divIcon({ html, className: "mark " + name, iconSize: [size, size] });

const NORTH = `<svg width="30" height="40" viewBox="-15 -22 30 40" role="img" aria-label="North is up"><path class="needle" d="M0-4 7 14 0 9-7 14Z"/><text class="needle" text-anchor="middle" y="-8">N</text></svg>`;

/** The map's top is north, always; this says so.
 * @param {any} map */
export function placeNorth(map) {
  const control = L.control({ position: "topright" });
  control.onAdd = () => {
    const element = L.DomUtil.create("div", "north");
    element.innerHTML = NORTH;
    return element;
  };
  control.addTo(map);
}

/** A name on the map, written as text and never as HTML.
 * @param {Place} at
 * @param {string} name
 * @param {string} kind */
export function nameMark(at, name, kind) {
  const span = document.createElement("span");
  span.textContent = name;
  const made = L.divIcon({ className: `roi ${kind}`, html: span });
  return L.marker(at, { icon: made, interactive: false, keyboard: false, zIndexOffset: -500 });
}

/** The border of an error ellipse as positions.
 * @param {FoundState} found
 * @returns {Place[]} */
export function ellipse({
  lat,
  lon,
  ellipse: { semi_major_m: a, semi_minor_m: b, bearing_deg: bearing },
}) {
  const turn = (bearing * Math.PI) / 180,
    metre = 1 / 111195,
    narrow = Math.cos((lat * Math.PI) / 180);
  return Array.from({ length: 48 }, (_, i) => {
    const along = a * Math.cos((i * Math.PI) / 24),
      across = b * Math.sin((i * Math.PI) / 24);
    const north = along * Math.cos(turn) - across * Math.sin(turn),
      east = along * Math.sin(turn) + across * Math.cos(turn);
    return [lat + north * metre, lon + (east * metre) / narrow];
  });
}
