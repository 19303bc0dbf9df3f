// Ground maps from the service itself.

import { ask } from "./link.js";

const L = window.L;

/** Tiles from the service itself: an image cannot send the token, a request can. */
export const OwnTiles = L.TileLayer.extend({
  /**
   * @param {unknown} coords
   * @param {(error: unknown, tile: HTMLImageElement) => void} done */
  createTile(coords, done) {
    const tile = document.createElement("img");
    tile.alt = "";
    ask(this.getTileUrl(coords))
      .then(async (answer) => {
        tile.onload = () => URL.revokeObjectURL(tile.src);
        tile.src = URL.createObjectURL(await answer.blob());
        done(null, tile);
      })
      .catch((error) => done(error, tile));
    return tile;
  },
});
