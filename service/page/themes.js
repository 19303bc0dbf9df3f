// Colours of the screen: day, bright sunlight, night.

import { $, remember, remembered } from "./dom.js";

const KEY = "theme";
const THEMES = ["day", "sun", "night"];

/** @type {(() => void)[]} */
const told = [];

export const isNight = () => document.documentElement.dataset.theme === "night";

/** Be called when the colours have changed.
 * @param {() => void} change */
export const onTheme = (change) => void told.push(change);

/** @param {string} name */
function set(name) {
  document.documentElement.dataset.theme = THEMES.includes(name) ? name : "day";
  for (const each of told) each();
}

set(remembered(KEY, "day"));
$("theme").value = document.documentElement.dataset.theme;
$("theme").addEventListener("change", () => {
  remember(KEY, $("theme").value);
  set($("theme").value);
});
