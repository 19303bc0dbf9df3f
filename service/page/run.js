// What is known of the run: a scene, and what the moments since have changed in it.

/** @param {string} text */
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

/** @type {Growing[]} */
const GROWING = ["hits", "curve"];

/** Cut a list where its news begin, and append them.
 * @param {Place[]} list
 * @param {RowsNews} news */
function renew(list, { from, rows }) {
  list.length = from;
  for (const row of rows) list.push(row);
}

export class Run {
  /** @param {Scene} scene */
  constructor(scene) {
    this.scene = scene;
    const cells = scene.frame.rows * scene.frame.cols;
    this.codes = new Uint8Array(cells); // of the belief; 0: not searched
    this.pod = new Uint8Array(cells); // in 255ths
    this.reference = 0;
    this.log2Total = 0;
    /** Positions flown, of each aircraft. @type {Place[][]} */
    this.tracks = [];
    /** Positions of hits. @type {Place[]} */
    this.hits = [];
    /** Seconds and POS. @type {Place[]} */
    this.curve = [];
    /** There from the first moment on; nothing is shown before. @type {RunState} */
    this.state = /** @type {any} */ (null);
  }

  /** Take a moment in; returns what has changed.
   * @param {Moment} moment */
  take(moment) {
    /** @type {Set<Changing>} */
    const changed = new Set();
    this.state = moment.state;
    const { belief, pod } = moment;
    if (belief.reference !== this.reference || belief.log2_total !== this.log2Total) {
      changed.add("belief");
    }
    this.reference = belief.reference;
    this.log2Total = belief.log2_total;
    if (this.patch(this.codes, belief)) changed.add("belief");
    if (this.patch(this.pod, pod)) changed.add("pod");
    for (const name of GROWING) {
      const news = moment[name];
      if (!news) continue;
      renew(this[name], news);
      changed.add(name);
    }
    (moment.tracks ?? [moment.track]).forEach((news, number) => {
      if (news) renew((this.tracks[number] ??= []), news);
    });
    return changed;
  }

  /**
   * @param {Uint8Array} target
   * @param {BytesNews} news */
  patch(target, news) {
    if (!news.codes) return false;
    const codes = bytes(news.codes);
    if (news.at) {
      new Uint32Array(bytes(news.at).buffer).forEach((cell, i) => (target[cell] = codes[i]));
    } else target.set(codes);
    return true;
  }

  /** The probability that a code stands for.
   * @param {number} code */
  probability(code) {
    return code ? 2 ** (this.reference + (code - 255) / 8 - this.log2Total) : 0;
  }

  /** The cell under a position, by the affine map that the grid's corners make; null off the grid.
   * @param {number} lat
   * @param {number} lon */
  cellAt(lat, lon) {
    const [nw, ne, , sw] = this.scene.frame.corners;
    const [ax, ay, bx, by] = [ne[1] - nw[1], ne[0] - nw[0], sw[1] - nw[1], sw[0] - nw[0]];
    const [x, y] = [lon - nw[1], lat - nw[0]];
    const area = ax * by - ay * bx;
    const col = Math.floor(((x * by - y * bx) / area) * this.scene.frame.cols);
    const row = Math.floor(((y * ax - x * ay) / area) * this.scene.frame.rows);
    if (row < 0 || col < 0 || row >= this.scene.frame.rows || col >= this.scene.frame.cols) {
      return null;
    }
    return row * this.scene.frame.cols + col;
  }
}
