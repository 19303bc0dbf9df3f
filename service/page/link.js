// The way to the service: requests with the token, and the one WebSocket that tells what happens.

const SILENT_MS = 6000; // four messages a second are usual: so long without one, and the line is dead
const LONGEST_PAUSE_MS = 4000;

// The token stays in this tab, and goes nowhere but into a header or a subprotocol: never into a URL.
const token = () => sessionStorage.getItem("token") || "";
/** @param {string} value */
export const keepToken = (value) => sessionStorage.setItem("token", value);

export const hasToken = () => token() !== "";

/** Ask the service; raises an Error with its `status` when it does not say 200.
 * @param {string} path
 * @param {RequestInit & { headers?: Record<string, string> }} options */
export async function ask(path, options = {}) {
  /** @type {Record<string, string>} */
  const headers = { ...options.headers };
  if (token()) headers.Authorization = "Bearer " + token();
  const answer = await fetch(path, { ...options, headers, cache: "no-store" });
  if (!answer.ok) {
    const said = await answer.json().catch(() => ({}));
    const detail = typeof said.detail === "string" ? said.detail : "error " + answer.status;
    throw Object.assign(new Error(detail), { status: answer.status });
  }
  return answer;
}

/** Give an order; what the service makes of it.
 * @param {{ command: string, lat?: number, lon?: number, aircraft?: string, system_id?: number }} body
 * @returns {Promise<{ state: string, refused?: string | null }>} */
export async function order(body) {
  const headers = { "Content-Type": "application/json" };
  return (
    await ask("/api/commands", { method: "POST", headers, body: JSON.stringify(body) })
  ).json();
}

function protocols() {
  if (!token()) return ["roisearch"];
  const coded = btoa(token()).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
  return ["roisearch", "bearer." + coded];
}

/** What becomes of listening; `refused` when a token is wanted.
 * @typedef {object} Listener
 * @property {(message: Scene | Drawn | Moment) => void} message
 * @property {() => void} up
 * @property {(error: Error) => void} down
 * @property {(error: Error) => void} refused */

/** Keep listening. */
export class Events {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  timer;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  silence;
  /** @type {WebSocket | null} */
  socket = null;

  /** @param {Listener} on */
  constructor(on) {
    this.on = on;
    this.failures = 0;
    /** @type {number | null} */
    this.at = null; // a replay's time
    this.open();
  }

  open() {
    clearTimeout(this.timer);
    this.timer = undefined;
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = (this.socket = new WebSocket(
      `${scheme}//${location.host}/api/events`,
      protocols(),
    ));
    socket.onmessage = (event) => {
      this.failures = 0;
      this.watch();
      this.on.message(JSON.parse(event.data));
    };
    socket.onopen = () => {
      this.watch();
      this.on.up();
      if (this.at !== null) this.show(this.at);
    };
    socket.onclose = () => {
      if (socket === this.socket) this.retry();
    };
  }

  watch() {
    clearTimeout(this.silence);
    this.silence = setTimeout(() => this.drop(), SILENT_MS);
  }

  drop() {
    const socket = this.socket;
    this.socket = null; // its close may come much later
    socket?.close();
    this.retry();
  }

  async retry() {
    clearTimeout(this.silence);
    if (this.timer) return;
    const pause = Math.min(LONGEST_PAUSE_MS, 250 * 2 ** this.failures++);
    this.timer = setTimeout(() => this.open(), pause);
    try {
      await ask("/api/state"); // why was it closed?
    } catch (caught) {
      const error = /** @type {Error & { status?: number }} */ (caught);
      if (error.status === 401 || error.status === 403) {
        clearTimeout(this.timer);
        this.timer = undefined;
        this.on.refused(error);
      } else this.on.down(error);
    }
  }

  /** Show a replay at a time (seconds since the epoch).
   * @param {number} at */
  show(at) {
    this.at = at;
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ at }));
  }
}
