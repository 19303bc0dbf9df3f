// Sound and notification: for who does not look at the screen all the time.

import { $, placeOf, remember, remembered, say } from "./dom.js";

const KEY = "alerts";
/** Tones of each kind of news, in hertz, one after the other. */
const TONES = { suspect: [880, 880], found: [660, 880, 1320] };
const TONE_S = 0.22;

/** @type {AudioContext | null} */
let audio = null;

const on = () => $("alerts").checked;

/** A browser plays nothing before somebody has touched the page. */
function wake() {
  if (!on()) return;
  audio ??= new AudioContext();
  audio.resume();
}

/** @param {"suspect" | "found"} kind */
function play(kind) {
  if (!audio || audio.state !== "running") return;
  const begin = audio.currentTime + 0.02;
  TONES[kind].forEach((pitch, i) => {
    const tone = /** @type {AudioContext} */ (audio).createOscillator(),
      loud = /** @type {AudioContext} */ (audio).createGain();
    tone.frequency.value = pitch;
    loud.gain.value = 0.25;
    tone.connect(loud).connect(/** @type {AudioContext} */ (audio).destination);
    tone.start(begin + i * 1.25 * TONE_S);
    tone.stop(begin + (i * 1.25 + 1) * TONE_S);
  });
}

/** @param {string} title
 * @param {string} body */
function notify(title, body) {
  if (!("Notification" in window) || Notification.permission !== "granted") return;
  try {
    new Notification(title, { body, tag: title });
  } catch {
    // phones show one only for a page that is installed; the sound is there all the same
  }
}

/** Say that something was seen, or found.
 * @param {"suspect" | "found"} kind
 * @param {{ written: string, lat: number, lon: number }} place
 * @param {string} area */
export function alertOf(kind, place, area) {
  if (!on()) return;
  play(kind);
  notify(kind === "found" ? "Found" : "Detection", `${placeOf(place)}, ${area}`);
}

async function change() {
  remember(KEY, on() ? "on" : "off");
  wake();
  say($("alerts-note"), on() ? await permission() : "");
}

/** What can be shown beside the sound. */
async function permission() {
  if (!("Notification" in window)) {
    return "Sound only: notifications need https, or this machine's own address.";
  }
  const given = Notification.permission;
  const may = given === "default" ? await Notification.requestPermission() : given;
  return may === "granted" ? "" : "Sound only: this browser allows no notifications from here.";
}

$("alerts").checked = remembered(KEY, "off") === "on";
$("alerts").addEventListener("change", change);
document.addEventListener("pointerdown", wake);
document.addEventListener("keydown", wake);
