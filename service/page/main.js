// The page: one connection, one run, one map.

import { alertOf } from "./alerts.js";
import { $, placeOf, say } from "./dom.js";
import { FINAL, several, showFleet, stillFleet } from "./fleet.js";
import { showFound, stillFound } from "./found.js";
import { showLayers, showLegend, showScale } from "./layers.js";
import { Events, hasToken, keepToken } from "./link.js";
import { Chart } from "./map.js";
import { offerPriors, placeByClick, showNews } from "./news.js";
import { showOrders } from "./orders.js";
import { showCurve, showFacts, showPos } from "./panel.js";
import { Replay } from "./replay.js";
import { Run } from "./run.js";
import { showNext, showStrip } from "./strip.js";
import { forgetSuspects, goToSuspects, showSuspects, stillSuspects } from "./suspects.js";
import { follow, placeTools, uncover } from "./tools.js";

const SAME_CELLS = 2; // so far may a detection move and still be the same

/** @type {Run | null} */
let run = null;
/** @type {Chart | null} */
let chart = null;
/** @type {Replay | null} */
let replay = null;
let live = false;
let heardAt = new Date();
let shown = false; // something was, of this scene: from then on what comes is news

/** @param {Scene} scene */
const place = (scene) => `view of ${scene.area} ${JSON.stringify(scene.frame.corners[0])}`;
/** What the map showed at an earlier visit.
 * @param {Scene} scene
 * @returns {View | null} */
function kept(scene) {
  try {
    return JSON.parse(localStorage.getItem(place(scene)) ?? "null");
  } catch {
    return null;
  }
}

/** @param {Scene} scene */
function begin(scene) {
  const before = run?.scene;
  run = new Run(scene);
  live = !scene.replay;
  shown = false;
  document.title = `${scene.area} · roisearch`;
  say($("area"), scene.area);
  offerPriors(scene.priors);
  $("orders").hidden = !live || scene.read_only;
  $("read-only").hidden = !live || !scene.read_only;
  if (scene.replay && !replay) {
    replay = new Replay(scene.replay, (at) => {
      forgetSuspects();
      events.show(at);
    });
  }
  if (chart && before && place(before) === place(scene)) {
    chart.run = run; // the service was started again: keep the view
    if (before.drawn !== scene.drawn) chart.redraw();
  } else {
    chart?.map.remove();
    const keep = (/** @type {View} */ view) =>
      localStorage.setItem(place(scene), JSON.stringify(view));
    chart = new Chart($("map"), run, kept(scene), keep, goToSuspects);
    chart.onView = showLegend;
    placeByClick(chart.map);
    placeTools(chart, scene.coordinates);
    showLayers(chart);
  }
}

/** The likely places lie elsewhere now.
 * @param {Drawn} drawn */
function redraw({ regions, names, drawn }) {
  if (!run || !chart) return;
  Object.assign(run.scene, { regions, names, drawn });
  chart.redraw();
}

/** @param {Moment} moment */
function show(moment) {
  if (!run || !chart) return; // no scene yet
  heardAt = new Date();
  const changed = run.take(moment);
  const { state, scene } = run;
  const mayOrder = live && !scene.read_only;
  const chip = $("chip");
  say(chip, live ? state.words : `${state.words} (replay)`);
  chip.dataset.state = state.state;
  showStrip(state);
  showOrders(several(state) ? state.aircraft.map((each) => each.orders) : [state.orders], mayOrder);
  showFleet(state, mayOrder);
  showPlaces(state, mayOrder);
  showNews(state.news, mayOrder);
  chart.draw(changed);
  follow(state);
  if (changed.has("belief") && chart.shows === "belief") showScale(chart.scale);
  if (changed.has("curve") || !$("curve").firstChild) showCurve(run);
  showPos(run);
  showNext(state);
  showFacts(state);
  replay?.shown(state.time);
  shown = true;
}

/** What was seen and what was found, and who is told of it.
 * @param {RunState} state
 * @param {boolean} mayOrder */
function showPlaces(state, mayOrder) {
  if (!run || !chart) return;
  const { area, frame } = run.scene;
  const goTo = (/** @type {{ lat: number, lon: number }} */ where) => {
    chart?.goTo(where);
    $("map").scrollIntoView({ block: "center" }); // on a phone the list lies below the map
  };
  const found = showFound(state, mayOrder, goTo);
  if (found && state.found) uncover(state.found, $("found"));
  const fresh = showSuspects(state, mayOrder, SAME_CELLS * frame.cell_m, goTo);
  if (!live || !shown) return;
  if (found && state.found) alertOf("found", state.found, area);
  else for (const each of fresh) alertOf("suspect", each, area);
}

/** The service has gone; after a run that is over that is as it should be.
 * @param {RunState | undefined} last */
function ended(last) {
  const found = last?.found ? `It was found at ${placeOf(last.found)}.` : "";
  say($("ended"), `The search is over and the service has ended. ${found}`.trim());
  $("ended").hidden = false;
}

const events = new Events({
  message: (message) => {
    if (message.type === "scene") begin(message);
    else if (message.type === "regions") redraw(message);
    else show(message);
  },
  up: () => {
    $("lost").hidden = true;
    $("ended").hidden = true;
    $("entry").hidden = true;
  },
  down: () => {
    showOrders([], false);
    stillFleet();
    stillSuspects();
    stillFound();
    if (run?.state && FINAL.includes(run.state.state)) return void ended(run.state);
    say($("lost"), "No connection to the service; trying again. What you see is not up to date.");
    $("lost").hidden = false;
    if (shown) say($("next"), `Last heard of at ${heardAt.toLocaleTimeString()}`);
    say($("chip"), "no connection");
    $("chip").dataset.state = "lost";
  },
  refused: (error) => {
    $("entry").hidden = false;
    say($("refused"), hasToken() ? error.message : "");
    say($("chip"), hasToken() ? "wrong token" : "a token is needed");
  },
});

$("entry").addEventListener("submit", (/** @type {SubmitEvent} */ event) => {
  event.preventDefault();
  keepToken($("token").value.trim());
  $("token").value = "";
  events.open();
});
