// News from the field: what stands, one click to take it back, and a form for more.

import { inWords } from "./cursor.js";
import { $, make, say } from "./dom.js";
import { ask } from "./link.js";
import { tell } from "./orders.js";
import { Sketch } from "./sketch.js";

const CORNERS = 32;
const METRES_PER_DEGREE = 111195;
const ROLES = {
  clue: "clue",
  searched: "searched by others",
  exclude: "not flown over",
  refute: "not assumed any more",
};
const METRES = {
  clue: "Still counts at, metres",
  searched: "Searched around it, metres",
  exclude: "Not within, metres",
  refute: "",
};

/** @typedef {keyof typeof ROLES} Role */

/** What is drawn for the form. @type {Sketch | null} */
let sketch = null;
/** Whether the map was asked for, and the form is gone on with afterwards. */
let placing = false;

/** Whether corners are set, and not one place. */
const outlined = () => $("news-shape").value !== "around" && $("news-role").value !== "refute";

/** A circle as a GeoJSON ring, longitude first.
 * @param {number} lat
 * @param {number} lon
 * @param {number} metres */
function ring(lat, lon, metres) {
  const high = metres / METRES_PER_DEGREE,
    wide = high / Math.cos((lat * Math.PI) / 180);
  return Array.from({ length: CORNERS + 1 }, (_, i) => {
    const angle = (2 * Math.PI * (i % CORNERS)) / CORNERS;
    return [lon + wide * Math.sin(angle), lat + high * Math.cos(angle)];
  });
}

/** Where it is: what is drawn, a circle, or the place itself.
 * @param {boolean} flat whether ground is meant, with a border */
function geometry(flat) {
  if (outlined()) return /** @type {Sketch} */ (sketch).geometry();
  const [lat, lon, metres] = ["news-lat", "news-lon", "news-metres"].map((id) =>
    Number($(id).value),
  );
  return flat
    ? { type: "Polygon", coordinates: [ring(lat, lon, metres)] }
    : { type: "Point", coordinates: [lon, lat] };
}

/** What the form says, as the service takes it. */
function feature() {
  const words = $("news-words").value.trim();
  const role = $("news-role").value;
  if (role === "refute") {
    const properties = { role, prior: $("news-prior").value, words };
    return { type: "Feature", geometry: null, properties };
  }
  const said = {
    clue: { bayes_factor: Number($("news-factor").value) },
    searched: { pod: Number($("news-pod").value) },
    exclude: {},
  }[/** @type {Exclude<Role, "refute">} */ (role)];
  const fades = role === "clue" && $("news-shape").value !== "ground"; // with the distance from it
  const sigma = fades ? { sigma_m: Number($("news-metres").value) } : {};
  const properties = { role, ...said, ...sigma, words };
  return { type: "Feature", geometry: geometry(role !== "clue"), properties };
}

/** @param {string} path
 * @param {object} [body] */
async function post(path, body) {
  const headers = { "Content-Type": "application/json" };
  const options = body
    ? { method: "POST", headers, body: JSON.stringify(body) }
    : { method: "POST" };
  return (await ask(path, options)).json();
}

/** @param {() => Promise<{ id: string, status: string, notes: string[] }>} doing */
async function say_of(doing) {
  try {
    const { id, status, notes } = await doing();
    tell([`${id}: ${status}`, ...notes].join("; "));
  } catch (error) {
    tell(/** @type {Error} */ (error).message);
  }
}

/** What may be refuted: the parts of the area file's prior.
 * @param {string[]} priors */
export function offerPriors(priors) {
  $("news-prior").replaceChildren(...priors.map((name) => make("option", { textContent: name })));
  $("news-role").querySelector("[value=refute]").hidden = !priors.length;
}

/** The list, rebuilt only when it is another one: nothing moves under a finger.
 * @param {NewsState[]} news
 * @param {boolean} mayOrder */
export function showNews(news, mayOrder) {
  const list = $("news"),
    wanted = JSON.stringify([news.map((each) => each.id), mayOrder]);
  $("news-card").hidden = !mayOrder && !news.length;
  $("news-form").hidden = !mayOrder;
  if (list.dataset.shown === wanted) return;
  list.dataset.shown = wanted;
  list.replaceChildren(...news.map((each) => item(each, mayOrder)));
}

/** @param {NewsState} told
 * @param {boolean} mayOrder */
function item(told, mayOrder) {
  const words = told.words || told.id;
  const parts = [
    make("strong", { textContent: words }),
    make("span", {
      className: "where",
      textContent: ROLES[/** @type {Role} */ (told.role)],
    }),
  ];
  if (mayOrder) {
    const back = make("button", {
      type: "button",
      textContent: "Take back",
      ariaLabel: `Take back: ${words}`,
    });
    const path = `/api/news/${encodeURIComponent(told.id)}/withdraw`;
    back.addEventListener("click", () => say_of(() => post(path)));
    parts.push(make("div", { className: "verdict" }, back));
  }
  return make("li", {}, ...parts);
}

/** Let clicks on the map fill the form in while it is open: the place, or corner after corner.
 * @param {any} map */
export function placeByClick(map) {
  sketch?.set([]);
  sketch = new Sketch(map);
  map.on("escape", () => {
    if (placing) $("news-words").focus();
    placing = false;
  });
  map.on("click", async (/** @type {{ latlng: { lat: number, lng: number } }} */ { latlng }) => {
    if (!$("news-form").open) return;
    if (outlined()) return void setCorners([...(sketch?.corners ?? []), latlng]);
    $("news-lat").value = latlng.lat.toFixed(6);
    $("news-lon").value = latlng.lng.toFixed(6);
    if (!placing) return;
    placing = false;
    $("news-metres").focus();
    tell(`The place is ${await inWords(latlng)}`);
  });
}

/** @param {any[]} corners */
function setCorners(corners) {
  sketch?.set(corners);
  showFields();
}

function showFields() {
  const shape = $("news-shape"),
    way = shape.querySelector("[value=way]");
  /** @type {Role} */
  const role = $("news-role").value;
  way.hidden = way.disabled = role !== "clue";
  if (way.disabled && shape.value === "way") shape.value = "ground";
  const refuted = role === "refute",
    drawn = outlined();
  /** @type {[string, boolean][]} */
  const fields = [
    ["news-prior", refuted],
    ["news-shape", !refuted],
    ["news-lat", !refuted && !drawn],
    ["news-lon", !refuted && !drawn],
    ["news-metres", !refuted && (!drawn || shape.value === "way")],
    ["news-factor", role === "clue"],
    ["news-pod", role === "searched"],
  ];
  for (const [id, wanted] of fields) {
    $(id).closest("label").hidden = !wanted;
    $(id).disabled = !wanted;
  }
  if (drawn) sketch?.as(shape.value);
  else sketch?.set([]);
  $("news-place").hidden = $("news-by-click").hidden = refuted;
  $("news-back").hidden = !drawn || !sketch?.corners.length;
  const set = `Each click on the map sets a corner; ${sketch?.words() ?? "none"} so far.`;
  say($("news-by-click"), drawn ? set : "A click on the map fills these in.");
  say($("news-metres-name"), METRES[role]);
}

$("news-place").addEventListener("click", (/** @type {MouseEvent} */ { detail }) => {
  placing = true;
  tell(
    detail
      ? outlined()
        ? "Click corner after corner on the map"
        : "Click the place on the map"
      : outlined()
        ? "Arrow keys move the map; Enter sets a corner under the cross-hair, Escape ends"
        : "Arrow keys move the map; Enter takes the place under the cross-hair",
  );
  $("map").scrollIntoView({ block: "center" }); // on a phone the form lies below the map
  if (!detail) $("map").focus();
});
$("news-back").addEventListener("click", () => {
  setCorners(sketch?.corners.slice(0, -1) ?? []);
  if ($("news-back").hidden) $("news-place").focus();
});
for (const id of ["news-role", "news-shape"]) $(id).addEventListener("change", showFields);
$("news-form").addEventListener("toggle", () => $("news-form").open || setCorners([]));
$("news-entry").addEventListener("submit", async (/** @type {Event} */ event) => {
  event.preventDefault();
  await say_of(async () => {
    const answer = await post("/api/news", feature());
    setCorners([]);
    return answer;
  });
});
showFields();
