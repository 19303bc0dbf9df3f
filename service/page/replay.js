// The time slider of a run that is over.

import { $, lasting, say } from "./dom.js";

const SPEED = 20; // seconds of the run a second
const TICK_MS = 250;

export class Replay {
  /** @type {ReturnType<typeof setInterval> | undefined} */
  playing;

  /**
   * @param {[number, number]} span first and last time, seconds since the epoch
   * @param {(at: number) => void} show */
  constructor([first, last], show) {
    this.first = first;
    this.last = last;
    this.show = show;
    const slider = $("time");
    Object.assign(slider, {
      min: 0,
      max: Math.ceil(last - first),
      step: 1,
      value: Math.ceil(last - first),
    });
    slider.addEventListener("input", () => this.go(Number(slider.value)));
    $("play").addEventListener("click", () => (this.playing ? this.stop() : this.play()));
    $("replay").hidden = false;
  }

  /** @param {number} seconds from the first time on */
  go(seconds) {
    this.show(this.first + seconds);
  }

  play() {
    const slider = $("time");
    if (Number(slider.value) >= Number(slider.max)) slider.value = 0;
    let at = Number(slider.value);
    this.playing = setInterval(() => {
      at = Math.min(Number(slider.max), at + (SPEED * TICK_MS) / 1000);
      slider.value = at;
      this.go(at);
      if (at >= Number(slider.max)) this.stop();
    }, TICK_MS);
    this.button("Pause", true);
  }

  stop() {
    clearInterval(this.playing);
    this.playing = undefined;
    this.button("Play", false);
  }

  /**
   * @param {string} text
   * @param {boolean} pressed */
  button(text, pressed) {
    say($("play"), text);
    $("play").setAttribute("aria-pressed", pressed);
  }

  /** @param {number} time */
  shown(time) {
    const text = `${lasting(Math.max(0, time - this.first))} of ${lasting(this.last - this.first)}`;
    say($("clock"), text);
    $("time").setAttribute("aria-valuetext", text);
  }
}
