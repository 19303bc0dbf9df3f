// Drawing a search: ground, exclusions, likely ground, lines and places, launch;
// saved as the area file and started from here.

import { announce, Crosshair } from "./crosshair.js";
import { showPlace, writeAs } from "./cursor.js";
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
  trail: {
    title: "Likely line",
    shape: "Line",
    role: "prior",
    colour: "#5b2a91",
    how: "Click along the trail, river, ridge or road; click the last corner again to end it.",
  },
  ipp: {
    title: "Last seen",
    shape: "Marker",
    role: "ipp",
    colour: "#5b2a91",
    how: "Click where the lost person was last known to be, then say who it is.",
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
const TYPES = {
  Point: "Marker",
  Polygon: "Polygon",
  MultiPolygon: "Polygon",
  LineString: "Line",
  MultiLineString: "Line",
};
/** Letters of pins; any other is a question mark. @type {Record<string, string>} */
const LETTERS = { launch: "H", ipp: "!" };
/** What can be said of a thing, in words. @type {Record<string, string>} */
const WORDS = {
  name: "Name",
  weight: "Weight",
  sigma_m: "Within about, metres",
  width_m: "Width, metres",
  subject: "Who is lost",
  terrain: "Terrain",
};
/** Who can be lost, with the terrains for which there are figures. @type {Record<string, string[]>} */
let subjects = {};

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
  return L.divIcon({
    className: "pin",
    html: `<span data-kind="${which}">${LETTERS[which] ?? "?"}</span>`,
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
    allowSelfIntersection: shape === "Line", // a trail may, a border may not
  });
  const sets = shape === "Marker" ? "sets it" : "sets a corner";
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
    ...(["prior", "ipp"].includes(role) ? { weight: number(known.weight ?? 1, "0.001") } : {}),
    ...(which === "point" ? { sigma_m: number(known.sigma_m ?? 50, "1") } : {}),
    ...(which === "trail" ? { width_m: number(known.width_m ?? 60, "1") } : {}),
    ...(which === "ipp" && !known.rings_m ? whoAndWhere(known) : {}),
  };
  const rows = Object.entries(fields).map(([name, field]) =>
    make("label", {}, `${WORDS[name]} `, field),
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

/** Whoever is lost, and the ground there: only what has published figures can be chosen.
 * @param {Record<string, any>} known */
function whoAndWhere(known) {
  // their names by themselves: a label around a choice counts the choices in
  const subject = make("select", { ariaLabel: WORDS.subject }),
    terrain = make("select", { ariaLabel: WORDS.terrain });
  offer(subject, Object.keys(subjects), known.subject ?? "hiker");
  subject.addEventListener("change", () => {
    const there = subjects[subject.value];
    offer(terrain, there, there.includes(terrain.value) ? terrain.value : there[0]);
  });
  offer(terrain, subjects[subject.value] ?? [], known.terrain);
  return { subject, terrain };
}

/** Let values be chosen, and what the file has too, however it is spelt.
 * @param {any} select
 * @param {string[]} values
 * @param {string | undefined} chosen */
function offer(select, values, chosen) {
  const all = chosen === undefined || values.includes(chosen) ? values : [chosen, ...values];
  select.replaceChildren(...all.map((value) => make("option", { value, textContent: value })));
  if (chosen !== undefined) select.value = chosen;
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
  layer.pm?.enable({ allowSelfIntersection: KINDS[which].shape === "Line" });
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
    const told = await (await ask("/api/plan")).json();
    const { drawn, tiles, coordinates } = told;
    subjects = told.subjects;
    $("entry").hidden = true;
    writeAs(coordinates);
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

const crosshair = new Crosshair(map, showPlace);
placeHandles(map, (which) => KINDS[which].title);

map.on("pm:create", (/** @type {any} */ { layer }) => {
  announce(`${KINDS[kind].title}: drawn.`);
  if (KINDS[kind].shape !== "Marker") return add(kind, layer);
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
