// News from the field: what stands, one click to take it back, and a form for more.

import { inWords } from "./cursor.js";
import { $, make, say } from "./dom.js";
import { ask } from "./link.js";
import { tell } from "./orders.js";

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

/** What the form says, as the service takes it. */
function feature() {
  const [lat, lon, metres] = ["news-lat", "news-lon", "news-metres"].map((id) =>
    Number($(id).value),
  );
  const words = $("news-words").value.trim();
  const role = $("news-role").value;
  if (role === "refute") {
    const properties = { role, prior: $("news-prior").value, words };
    return { type: "Feature", geometry: null, properties };
  }
  if (role !== "clue") {
    const geometry = { type: "Polygon", coordinates: [ring(lat, lon, metres)] };
    const pod = role === "searched" ? { pod: Number($("news-pod").value) } : {};
    return { type: "Feature", geometry, properties: { role, ...pod, words } };
  }
  return {
    type: "Feature",
    geometry: { type: "Point", coordinates: [lon, lat] },
    properties: {
      role: "clue",
      bayes_factor: Number($("news-factor").value),
      sigma_m: metres,
      words,
    },
  };
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

/** Whether the map was asked for, and the form is gone on with afterwards. */
let placing = false;

/** Let a click on the map fill the form in while it is open.
 * @param {any} map */
export function placeByClick(map) {
  map.on("click", async (/** @type {{ latlng: { lat: number, lng: number } }} */ { latlng }) => {
    if (!$("news-form").open) return;
    $("news-lat").value = latlng.lat.toFixed(6);
    $("news-lon").value = latlng.lng.toFixed(6);
    if (!placing) return;
    placing = false;
    $("news-metres").focus();
    tell(`The place is ${await inWords(latlng)}`);
  });
}

function showFields() {
  /** @type {Role} */
  const role = $("news-role").value;
  const placed = ["clue", "searched", "exclude"];
  /** @type {[string, string[]][]} */
  const fields = [
    ["news-prior", ["refute"]],
    ["news-lat", placed],
    ["news-lon", placed],
    ["news-metres", placed],
    ["news-factor", ["clue"]],
    ["news-pod", ["searched"]],
  ];
  for (const [id, of] of fields) {
    $(id).closest("label").hidden = !of.includes(role);
    $(id).disabled = !of.includes(role);
  }
  $("news-place").hidden = !placed.includes(role);
  $("news-by-click").hidden = !placed.includes(role);
  say($("news-metres-name"), METRES[role]);
}

$("news-place").addEventListener("click", (/** @type {MouseEvent} */ { detail }) => {
  placing = true;
  tell(
    detail
      ? "Click the place on the map"
      : "Arrow keys move the map; Enter takes the place under the cross-hair",
  );
  $("map").scrollIntoView({ block: "center" }); // on a phone the form lies below the map
  if (!detail) $("map").focus();
});
$("news-role").addEventListener("change", showFields);
$("news-entry").addEventListener("submit", async (/** @type {Event} */ event) => {
  event.preventDefault();
  await say_of(() => post("/api/news", feature()));
});
showFields();
