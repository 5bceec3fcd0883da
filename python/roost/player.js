// @ts-check
// The playback widget: the dashboard's player on the bytes of a stream of frames. `python/stage.py` joins it with the modules it imports.

import { h } from "../../server/dashboard/dom.js";
import { player } from "../../server/dashboard/playback/player.js";

/**
 * The side of a widget in the browser, as anywidget passes it.
 * @typedef {{ get: (name: string) => any, set: (name: string, value: unknown) => void, save_changes: () => void, on: (event: string, done: () => void) => void, off: (event: string, done: () => void) => void }} Model
 */

/** Whether the notebook has a dark theme: JupyterLab and VS Code mark their pages. */
const isDark = () => document.body.dataset.jpThemeLight === "false" || document.body.classList.contains("vscode-dark");

/**
 * Shows the player in an element. The shadow tree keeps the styles of dashboard and notebook apart.
 * @param {{ model: Model, el: HTMLElement }} view
 */
async function render({ model, el }) {
  // Keys of the player are no shortcuts of JupyterLab.
  const host = h("div", { "data-theme": isDark() ? "dark" : "light", "data-lm-suppress-shortcuts": "true" });
  const place = h("div"), message = h("p", { class: "fault", role: "status", hidden: true });
  const announce = (/** @type {string} */ text) => {
    message.textContent = text;
    message.hidden = false;
  };
  const kept = (/** @type {string} */ name) => (model.get(name) === "" ? null : String(model.get(name)));
  const keep = (/** @type {Record<string, string | number>} */ choices) => {
    for (const [name, value] of Object.entries(choices)) model.set(name, value);
    model.save_changes();
  };
  /** @type {Awaited<ReturnType<typeof player>>} */
  let playing = null;
  let url = "", shown = 0;
  const end = () => {
    playing?.end();
    URL.revokeObjectURL(url);
  };
  const show = async () => {
    const mine = ++shown;
    end();
    url = URL.createObjectURL(new Blob([model.get("content")]));
    message.hidden = true;
    const next = await player(url, { kept, keep, announce }).catch((error) => (announce(error.message), null));
    if (mine !== shown) return next?.end();
    playing = next;
    if (!next && message.hidden) announce("There are no frames yet.");
    place.replaceChildren(...(next ? [next.element] : []));
  };
  model.on("change:content", show);
  el.append(host);
  host.attachShadow({ mode: "open" }).append(h("style", {}, model.get("_style")), message, place);
  await show();
  return () => {
    shown++;
    model.off("change:content", show);
    end();
  };
}

export default { render };
