// Drawing a search: ground, exclusions, likely places, launch; saved as the area file and started from here.

import { announce, Crosshair } from "./crosshair.js";
import { Cursor } from "./cursor.js";
import { $, make, say } from "./dom.js";
import { placeHandles } from "./handles.js";
import { ask, hasToken, keepToken } from "./link.js";
import { placeNorth } from "./marks.js";
import "./themes.js";
import { OwnTiles } from "./tiles.js";

const L = window.L;
const POLL_MS = 500;

/** What each thing is on the map and in the file.
 * @type {Record<string, { title: string, shape: string, role: string, colour: string, how: string }>} */
const KINDS = {
  search: {
    title: "Ground to search",
    shape: "Polygon",
    role: "search",
    colour: "#0d1620",
    how: "Click the corners; click the first one again to close it.",
  },
  exclude: {
    title: "Never fly here",
    shape: "Polygon",
    role: "exclude",
    colour: "#b00020",
    how: "Click the corners; click the first one again to close it.",
  },
  likely: {
    title: "Likely ground",
    shape: "Polygon",
    role: "prior",
    colour: "#5b2a91",
    how: "Click the corners; click the first one again to close it.",
  },
  point: {
    title: "Likely place",
    shape: "Marker",
    role: "prior",
    colour: "#5b2a91",
    how: "Click the place.",
  },
  launch: {
    title: "Launch",
    shape: "Marker",
    role: "launch",
    colour: "#0b4aa2",
    how: "Click where it takes off and lands.",
  },
};
const TYPES = { Point: "Marker", Polygon: "Polygon", MultiPolygon: "Polygon" };

/** @typedef {object} Thing
 * @property {string} kind
 * @property {any} layer
 * @property {any} item its line in the list
 * @property {Record<string, any>} fields
 * @property {Record<string, unknown>} kept properties that the file has already */

/** @type {Thing[]} */
let things = [];
/** What the file holds and nobody draws here: it stays as it is. @type {any[]} */
let others = [];
let kind = "search";

const map = L.map($("map"), { maxZoom: 21, attributionControl: false }).setView([20, 0], 2);
L.control.scale({ imperial: false, maxWidth: 160 }).addTo(map);
placeNorth(map);
map.pm.setGlobalOptions({
  snappable: false,
  allowSelfIntersection: false,
  continueDrawing: false,
  removeLayerBelowMinVertexCount: false,
  tooltips: false,
});

/** @param {string} which */
function mark(which) {
  const letter = which === "launch" ? "H" : "?";
  return L.divIcon({
    className: "pin",
    html: `<span data-kind="${which}">${letter}</span>`,
    iconSize: [30, 30],
  });
}

/** A pin that the map library itself lets be dragged.
 * @param {any} at
 * @param {string} which */
const pinAt = (at, which) =>
  L.marker(at, { icon: mark(which), draggable: true, pmIgnore: true, alt: KINDS[which].title });

/** @param {{ currentTarget: any, detail: number }} pressed by a key where no click is counted */
function begin({ currentTarget, detail }) {
  kind = currentTarget.dataset.role;
  const which = kind,
    { title, shape, colour, how } = KINDS[which];
  say($("how"), how);
  $("map").scrollIntoView({ block: "nearest" }); // on a phone it lies above the buttons
  map.pm.disableDraw();
  map.pm.enableDraw(shape, {
    pathOptions: { color: colour, fillOpacity: 0.12 },
    templineStyle: { color: colour },
    hintlineStyle: { color: colour, dashArray: "5 5" },
    markerStyle: { icon: mark(which) },
  });
  const sets = shape === "Polygon" ? "sets a corner" : "sets it";
  const keys = `${title}: arrow keys move the map under the cross-hair, Enter ${sets}.`;
  crosshair.begin(detail ? `${title}: ${how}` : keys, currentTarget, !detail);
}

/** A line of the list, with what can be said about the thing.
 * @param {string} which
 * @param {Record<string, any>} known
 * @returns {{ item: any, fields: Record<string, any> }} */
function makeItem(which, known) {
  const { title, role } = KINDS[which];
  const fields = {
    name: make("input", { type: "text", maxLength: 80, value: known.name ?? "" }),
    ...(role === "prior" ? { weight: number(known.weight ?? 1, "0.001") } : {}),
    ...(which === "point" ? { sigma_m: number(known.sigma_m ?? 50, "1") } : {}),
  };
  const words = { name: "Name", weight: "Weight", sigma_m: "Within about, metres" };
  const rows = Object.entries(fields).map(([name, field]) =>
    make("label", {}, words[/** @type {keyof typeof words} */ (name)] + " ", field),
  );
  const remove = make("button", {
    type: "button",
    textContent: "Remove",
    ariaLabel: `Remove: ${title}`,
  });
  const item = make("li", {}, make("strong", { textContent: title }), ...rows, remove);
  remove.addEventListener("click", () => drop(item));
  item.addEventListener("input", changed);
  return { item, fields };
}

/** @param {number} value
 * @param {string} least */
const number = (value, least) => make("input", { type: "number", step: "any", min: least, value });

/** @param {string} which
 * @param {any} layer
 * @param {Record<string, any>} known properties that the file has already */
function add(which, layer, known = {}) {
  if (which === "launch") {
    for (const each of things.filter((thing) => thing.kind === "launch")) drop(each.item);
  }
  const { item, fields } = makeItem(which, known);
  things.push({ kind: which, layer, item, fields, kept: known });
  $("drawn").append(item);
  layer.addTo(map);
  layer.pm?.enable({ allowSelfIntersection: false });
  layer.on("pm:edit pm:markerdragend dragend", changed);
  changed();
}

/** @param {any} item */
function drop(item) {
  for (const thing of things.filter((each) => each.item === item)) thing.layer.remove();
  things = things.filter((each) => each.item !== item);
  item.remove();
  changed();
}

function changed() {
  $("none").hidden = things.length > 0;
  $("start").disabled = true;
  const ground = things.some((each) => each.kind === "search");
  say($("next"), ground ? "Save, then start the search." : "Draw the ground to search first.");
}

/** @param {Thing} thing */
function featureOf({ kind: which, layer, fields, kept }) {
  const { geometry } = layer.toGeoJSON(7);
  const said = Object.entries(fields).map(([name, { type, value }]) => [
    name,
    type === "number" ? Number(value) : value.trim(),
  ]);
  const known = Object.fromEntries(said);
  return { type: "Feature", geometry, properties: { ...kept, role: KINDS[which].role, ...known } };
}

const post = (/** @type {string} */ path, /** @type {object} */ body) =>
  ask(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  }).then((answer) => answer.json());

async function save() {
  const name = $("name").value.trim();
  try {
    const features = [...things.map(featureOf), ...others];
    const told = await post("/api/plan", { type: "FeatureCollection", name, features });
    say($("told"), `Saved in ${told.file}: ${told.km2.toFixed(2)} km², ${told.cells} cells.`);
    $("notes").replaceChildren(
      ...told.notes.map((/** @type {string} */ note) => make("li", { textContent: note })),
    );
    $("start").disabled = false;
    say($("next"), "Saved. The search can be started.");
  } catch (error) {
    $("notes").replaceChildren();
    say($("told"), /** @type {Error} */ (error).message);
  }
}

/** The search comes up at this same address; until it does, nobody answers. */
async function start() {
  $("start").disabled = true;
  try {
    await post("/api/plan/start", {});
  } catch (error) {
    return void say($("told"), /** @type {Error} */ (error).message);
  }
  say($("next"), "The search is starting.");
  while (!(await comeUp())) await new Promise((settle) => setTimeout(settle, POLL_MS));
  return void location.reload();
}

/** Whether the search answers already. One question at a time: those that wait for a busy service are answered all at
 * once, and too many in a second are refused. */
async function comeUp() {
  const answer = await fetch("/healthz", { cache: "no-store" }).catch(() => null);
  return answer?.ok && (await answer.text()) === "ok\n";
}

/** Draw what a file holds.
 * @param {{ name?: string, features: any[] }} drawn */
function load({ name, features }) {
  $("name").value = name ?? "";
  others = [];
  for (const feature of features) {
    const { role } = feature.properties;
    const shape = TYPES[/** @type {keyof typeof TYPES} */ (feature.geometry?.type)];
    const found = Object.keys(KINDS).find(
      (each) => KINDS[each].role === role && KINDS[each].shape === shape,
    );
    if (!found) {
      others.push(feature);
      say($("told"), "Some of the file cannot be drawn here; it stays in the file as it is.");
    } else {
      const made = L.GeoJSON.geometryToLayer(feature, {
        pointToLayer: (/** @type {any} */ _, /** @type {any} */ at) => pinAt(at, found),
      });
      made.setStyle?.({ color: KINDS[found].colour, fillOpacity: 0.12 });
      add(found, made, feature.properties);
    }
  }
  const all = L.featureGroup(things.map((each) => each.layer));
  if (things.length) map.fitBounds(all.getBounds(), { maxZoom: 17, padding: [30, 30] });
}

async function open() {
  try {
    const { drawn, tiles, coordinates } = await (await ask("/api/plan")).json();
    $("entry").hidden = true;
    cursor = new Cursor(coordinates);
    if (tiles) {
      const layer = tiles.own ? new OwnTiles(tiles.url, tiles) : L.tileLayer(tiles.url, tiles);
      layer.addTo(map);
    }
    if (drawn) load(drawn);
  } catch (caught) {
    const error = /** @type {Error & { status?: number }} */ (caught);
    $("entry").hidden = error.status !== 401;
    say(
      $(error.status === 401 ? "refused" : "told"),
      error.status === 401 && !hasToken() ? "" : error.message,
    );
  }
}

let cursor = new Cursor("degrees");
const showPlace = (/** @type {any} */ at) => cursor.show(at);
const crosshair = new Crosshair(map, showPlace);
placeHandles(map, (which) => KINDS[which].title);

map.on("pm:create", (/** @type {any} */ { layer }) => {
  announce(`${KINDS[kind].title}: drawn.`);
  if (KINDS[kind].shape === "Polygon") return add(kind, layer);
  layer.remove();
  return add(kind, pinAt(layer.getLatLng(), kind));
});
map.on("mousemove click", (/** @type {any} */ { latlng }) => showPlace(latlng));
for (const button of $("draw").children) button.addEventListener("click", begin);
$("save").addEventListener("click", save);
$("start").addEventListener("click", start);
$("name").addEventListener("input", changed);
$("tools").addEventListener("submit", (/** @type {Event} */ event) => {
  event.preventDefault();
  map.setView([Number($("lat").value), Number($("lon").value)], 15);
});
$("entry").addEventListener("submit", (/** @type {Event} */ event) => {
  event.preventDefault();
  keepToken($("token").value.trim());
  $("token").value = "";
  open();
});
open();
