// The page: one connection, one run, one map.

import { Events, keepToken } from "./link.js";
import { Chart } from "./map.js";
import { showOrders, showSuspects } from "./orders.js";
import { $, say, showCurve, showFacts, showLayers, showNext, showPos, showScale } from "./panel.js";
import { Replay } from "./replay.js";
import { Run } from "./run.js";

let run = null, chart = null, replay = null, live = false;

const place = (scene) => `view of ${scene.area} ${JSON.stringify(scene.frame.corners[0])}`;
function kept(scene) {
  try {
    return JSON.parse(localStorage.getItem(place(scene)));
  } catch {
    return null;
  }
}

function begin(scene) {
  const before = run?.scene;
  run = new Run(scene);
  live = !scene.replay;
  document.title = `${scene.area} · roisearch`;
  say($("area"), scene.area);
  $("orders").hidden = !live;
  if (!live && !replay) replay = new Replay(scene.replay, (at) => events.show(at));
  if (before && place(before) === place(scene)) chart.run = run; // the service was started again: keep the view
  else {
    chart?.map.remove();
    const keep = (view) => localStorage.setItem(place(scene), JSON.stringify(view));
    chart = new Chart($("map"), run, kept(scene), keep, () => $("suspects-card").scrollIntoView({ block: "nearest" }));
    showLayers(chart);
  }
}

function show(moment) {
  const changed = run.take(moment), { state } = run;
  const chip = $("chip");
  say(chip, live ? state.state : `${state.state} (replay)`);
  chip.dataset.state = state.state;
  say($("why"), state.why ?? "");
  showOrders(state.state, live);
  showSuspects(state, live, (each) => chart.goTo(each));
  chart.draw(changed);
  if (changed.has("belief")) showScale(chart.top);
  if (changed.has("curve") || !$("curve").firstChild) showCurve(run);
  showPos(run);
  showNext(state);
  showFacts(state);
  replay?.shown(state.time);
}

const FINAL = ["DONE", "ABORTED"];
const events = new Events({
  message: (message) => (message.type === "scene" ? begin(message) : run && show(message)),
  up: () => {
    $("lost").hidden = true;
    $("entry").hidden = true;
  },
  down: () => {
    const over = FINAL.includes(run?.state?.state);
    say($("lost"), over ? "The run is over and the service has ended; this is what it last told." : "No connection to the service; trying again. What you see is not up to date.");
    $("lost").hidden = false;
    if (!over) {
      say($("chip"), "no connection");
      $("chip").dataset.state = "lost";
    }
    showOrders("", false);
  },
  refused: (error) => {
    $("entry").hidden = false;
    say($("refused"), sessionStorage.getItem("token") ? error.message : "");
    say($("chip"), "a token is needed");
  },
});

$("entry").addEventListener("submit", (event) => {
  event.preventDefault();
  keepToken($("token").value.trim());
  $("token").value = "";
  events.open();
});
