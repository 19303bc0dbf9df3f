// Pictures of detections: those that the service keeps are shown, those from elsewhere only on a click.

import { make } from "./dom.js";
import { ask } from "./link.js";

const KEPT = "/api/pictures/";

/** A place for a picture, of one size whether there is one or not, so that nothing moves when it comes.
 * @param {string} about what it shows
 * @returns {HTMLElement} */
export const frame = (about) => make("div", { className: "picture", title: about });

/** Show a picture in its place; an image cannot send the token, so it is asked for.
 * @param {any} place
 * @param {string | null} address
 * @param {string} about */
export function fill(place, address, about) {
  if (place.dataset.shown === (address ?? "")) return;
  place.dataset.shown = address ?? "";
  if (!address) return void place.replaceChildren(make("span", { textContent: "no picture" }));
  if (!address.startsWith(KEPT)) {
    const link = { href: address, target: "_blank", rel: "noreferrer", textContent: "Picture" };
    return void place.replaceChildren(make("a", link));
  }
  ask(address)
    .then(async (answer) => {
      const image = make("img", { alt: about, src: URL.createObjectURL(await answer.blob()) });
      image.addEventListener("load", () => URL.revokeObjectURL(image.src), { once: true });
      const open = make("button", { type: "button", ariaLabel: `Enlarge: ${about}` }, image);
      open.addEventListener("click", () => enlarge(image));
      place.replaceChildren(open);
    })
    .catch(() => place.replaceChildren(make("span", { textContent: "picture not there" })));
}

/** @param {HTMLImageElement} image */
function enlarge(image) {
  const canvas = make("canvas", { width: image.naturalWidth, height: image.naturalHeight });
  canvas.getContext("2d").drawImage(image, 0, 0);
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", image.alt);
  const close = make("button", { type: "submit", textContent: "Close" });
  const dialog = make(
    "dialog",
    { className: "large", ariaLabel: image.alt },
    make("form", { method: "dialog" }, canvas, close),
  );
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
