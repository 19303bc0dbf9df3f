// Drawing without a pointer: the map moves under a cross-hair in its middle, and a corner is set where that points.
// What is drawn by keys or buttons and what is drawn by clicks is one drawing; both may take turns at it.

import { inWords } from "./cursor.js";
import { $, say } from "./dom.js";

const STEP_PX = 20;
const LEAP_PX = 100; // with Shift
const SAME_PX = 12; // so near to the first corner it is meant
const PAUSE_MS = 350; // after the last move, until the place is told

/** What has corners: how many it needs, how it is called, and what ends it.
 * @type {Record<string, { least: number, needs: string, end: string }>} */
const CORNERED = {
  Polygon: { least: 3, needs: "Ground needs three corners", end: "Close" },
  Line: { least: 2, needs: "A line needs two corners", end: "End" },
};

/** @type {Record<string, [number, number]>} */
export const ARROWS = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

/** How far an arrow key goes on the screen; null for any other key.
 * @param {KeyboardEvent} event
 * @returns {[number, number] | null} */
export function strideOf({ key, shiftKey, ctrlKey, altKey, metaKey }) {
  const way = ARROWS[key];
  if (!way || ctrlKey || altKey || metaKey) return null;
  const pixels = shiftKey ? LEAP_PX : STEP_PX;
  return [way[0] * pixels, way[1] * pixels];
}

/** Say what has just happened: it is read out, and it stands over the map.
 * @param {string} text */
export const announce = (text) => say($("aimed"), text);

/** @param {number} count */
const corners = (count) => (count === 1 ? "1 corner" : `${count} corners`);

export class Crosshair {
  /** Whether something is being drawn. */
  drawing = false;
  /** What is drawn, in the words of the drawing plugin. */
  shape = "";
  /** The line so far; null for a thing of one point. @type {any} */
  line = null;
  /** What has the keyboard again afterwards. @type {any} */
  back = null;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  timer;

  /** @param {any} map
   * @param {(at: any) => void} onAim is told of each place under the cross-hair */
  constructor(map, onAim) {
    this.map = map;
    this.onAim = onAim;
    map.on("pm:drawstart", (/** @type {any} */ { shape, workingLayer }) => {
      this.shape = shape;
      this.line = CORNERED[shape] ? workingLayer : null;
      this.show(true);
    });
    map.on("pm:drawend", () => this.show(false));
    map.on("move", () => this.moved());
    // before the map library, whose arrow keys go further than a corner wants
    map.getContainer().addEventListener("keydown", (/** @type {any} */ event) => this.key(event), {
      capture: true,
    });
    $("set").addEventListener("click", () => this.set());
    $("take-back").addEventListener("click", () => this.takeBack());
    $("close").addEventListener("click", () => this.close());
    $("give-up").addEventListener("click", () => this.giveUp());
  }

  /** What was pressed to draw has begun a drawing.
   * @param {string} how what to do, in words
   * @param {any} button what was pressed
   * @param {boolean} byKeys rather than by a pointer */
  begin(how, button, byKeys) {
    this.back = button;
    document.body.classList.toggle("by-keys", byKeys);
    announce(how);
    if (byKeys) this.map.getContainer().focus();
  }

  /** @param {boolean} drawing */
  show(drawing) {
    this.drawing = drawing;
    $("aim").hidden = $("crosshair").hidden = !drawing;
    $("close").hidden = $("take-back").hidden = !this.line;
    say($("close"), CORNERED[this.shape]?.end ?? "");
    this.hush();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const container = this.map.getContainer();
    if (!this.drawing || event.target !== container) return;
    const stride = strideOf(event);
    const does = stride ? () => this.go(stride) : this.doing(event.key);
    if (!does) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    document.body.classList.add("by-keys");
    does();
  }

  /** What a key does.
   * @param {string} key
   * @returns {(() => void) | undefined} */
  doing(key) {
    return {
      Enter: () => this.set(),
      " ": () => this.set(),
      Backspace: () => this.takeBack(),
      Escape: () => this.giveUp(),
    }[key];
  }

  /** @param {[number, number]} stride */
  go(stride) {
    this.map.panBy(stride, { animate: false });
  }

  /** The corners that are set. @returns {any[]} */
  corners() {
    return this.line?.getLatLngs() ?? [];
  }

  /** Metres between the last corner and a place, in words.
   * @param {any} at */
  fromLast(at) {
    const last = this.corners().at(-1);
    return last ? `, ${Math.round(this.map.distance(last, at))} m from the last corner` : "";
  }

  /** Tell the place, once it stays. */
  moved() {
    if (!this.drawing) return;
    const at = this.map.getCenter();
    this.onAim(at);
    clearTimeout(this.timer);
    const timer = setTimeout(() => this.tellPlace(at, timer), PAUSE_MS);
    this.timer = timer;
  }

  /** Say where the cross-hair is, unless something else has been said or done meanwhile.
   * @param {any} at
   * @param {ReturnType<typeof setTimeout>} timer */
  async tellPlace(at, timer) {
    const words = this.onFirst(at)
      ? "On the first corner: set it again to close the ground."
      : `${await inWords(at)}${this.fromLast(at)}`;
    if (this.timer === timer) announce(words);
  }

  /** What was going to be said of a place is not said any more. */
  hush() {
    clearTimeout(this.timer);
    this.timer = undefined;
  }

  /** Whether a place is the first corner, and the ground can be closed there.
   * @param {any} at */
  onFirst(at) {
    const set = this.corners();
    if (this.shape !== "Polygon" || set.length < CORNERED.Polygon.least) return false;
    const [one, other] = [at, set[0]].map((each) => this.map.latLngToContainerPoint(each));
    return one.distanceTo(other) <= SAME_PX;
  }

  /** A corner, or the one point, where the cross-hair points. */
  set() {
    const at = this.map.getCenter();
    if (this.onFirst(at)) return void this.close();
    const words = this.fromLast(at),
      before = this.corners().length;
    this.click(at);
    const after = this.corners().length;
    if (!this.drawing) this.end();
    else if (after > before) announce(`Corner ${after} set${words}.`);
    else announce(this.refused(at));
  }

  /** Why there is no corner here.
   * @param {any} at */
  refused(at) {
    const same = this.corners().some((each) => each.equals(at));
    return same
      ? `There is a corner here already. ${CORNERED[this.shape].needs}.`
      : "No corner is set: the border would cross itself.";
  }

  /** Close the ground, or end the line. */
  close() {
    const set = this.corners(),
      { least, needs } = CORNERED[this.shape];
    if (set.length < least) return void announce(`${needs}, and there are ${set.length}.`);
    this.click(this.shape === "Polygon" ? set[0] : set.at(-1));
    if (this.drawing) announce("It cannot be closed: the border would cross itself.");
    else this.end();
  }

  /** What a click there does: the drawing plugin asks no more of it.
   * @param {any} latlng */
  click(latlng) {
    this.hush();
    this.map.fire("click", { latlng });
  }

  /** Take the last corner back. */
  takeBack() {
    const count = this.corners().length;
    if (!count) return void announce("There is no corner to take back.");
    const drawer = this.map.pm.Draw[this.shape];
    if (count > 1) {
      drawer._removeLastVertex();
    } // what the plugin's own toolbar calls
    else {
      this.map.pm.disableDraw();
      this.map.pm.enableDraw(this.shape, drawer.options);
    }
    return void announce(`Taken back; ${corners(count - 1)} left.`);
  }

  giveUp() {
    this.map.pm.disableDraw();
    announce("Given up; nothing is drawn.");
    this.end();
  }

  /** Who has come by keys goes on by keys; a finger would see the page jump. */
  end() {
    if (document.body.classList.contains("by-keys")) this.back?.focus();
  }
}
