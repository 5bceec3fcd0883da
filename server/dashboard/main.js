// @ts-check
// Entry of every page: theme, navigation, and the module that belongs to the path.

import { h } from "./dom.js";
import { keepTime } from "./parts.js";
import { readSchema } from "./schema.js";
import { addSignOut } from "./session.js";

/** @type {[pattern: RegExp, module: string][]} */
const PAGES = [
  [/^\/$/, "sweeps"],
  [/^\/sweeps\/([^/]+)$/, "sweep"],
  [/^\/studies$/, "studies"],
  [/^\/studies\/([^/]+)$/, "study"],
  [/^\/jobs\/([^/]+)$/, "job"],
  [/^\/workers$/, "workers"],
  [/^\/projects$/, "projects"],
  [/^\/compare$/, "compare"],
  [/^\/submit$/, "submit"],
];

function applyTheme() {
  const choice = /** @type {HTMLSelectElement} */ (document.getElementById("theme"));
  const system = matchMedia("(prefers-color-scheme: dark)");
  const apply = () => {
    const is_dark = choice.value === "auto" ? system.matches : choice.value === "dark";
    document.documentElement.dataset.theme = is_dark ? "dark" : "light";
    dispatchEvent(new Event("theme"));
  };
  choice.value = new URLSearchParams(location.search).get("theme") ?? localStorage.getItem("theme") ?? "auto";
  choice.addEventListener("change", () => {
    localStorage.setItem("theme", choice.value);
    apply();
  });
  system.addEventListener("change", apply);
  apply();
}

/** Time between two renewals of the times since a moment. */
const RENEW_MS = 5000;

async function start() {
  applyTheme();
  setInterval(keepTime, RENEW_MS);
  addSignOut(/** @type {HTMLElement} */ (document.querySelector("header"))).catch(() => {});
  const links = /** @type {NodeListOf<HTMLAnchorElement>} */ (document.querySelectorAll("nav a"));
  for (const link of links) {
    const path = new URL(link.href).pathname;
    const is_current = path === location.pathname || location.pathname.startsWith(path === "/" ? "/sweeps/" : `${path}/`);
    if (is_current) link.setAttribute("aria-current", "page");
  }
  const main = /** @type {HTMLElement} */ (document.getElementById("main"));
  try {
    const [pattern, module] = PAGES.find(([pattern]) => pattern.test(location.pathname)) ?? [];
    // Without the schema, labels of factors have no units.
    const [page] = await Promise.all([import(`./pages/${module}.js`), readSchema().catch(() => null)]);
    await page.show(main, ...(pattern?.exec(location.pathname) ?? []).slice(1));
  } catch (error) {
    main.replaceChildren(h("h1", {}, "This page cannot be shown"), h("p", { class: "fault", role: "alert" }, /** @type {Error} */ (error).message));
    console.error(error);
  }
}

start();
