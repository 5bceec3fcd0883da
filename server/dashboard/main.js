// Where every page begins: the theme, the mark in the navigation, and the page that belongs to the path.

import { h } from "./dom.js";
import { signOut } from "./session.js";

const PAGES = [
  [/^\/$/, "sweeps"],
  [/^\/sweeps\/([^/]+)$/, "sweep"],
  [/^\/jobs\/([^/]+)$/, "job"],
  [/^\/workers$/, "workers"],
  [/^\/compare$/, "compare"],
  [/^\/submit$/, "submit"],
];

function theme() {
  const choice = document.getElementById("theme");
  const system = matchMedia("(prefers-color-scheme: dark)");
  const apply = () => {
    const is_dark = choice.value === "auto" ? system.matches : choice.value === "dark";
    document.documentElement.dataset.theme = is_dark ? "dark" : "light";
    dispatchEvent(new Event("theme"));
  };
  choice.value = new URLSearchParams(location.search).get("theme") ?? localStorage.getItem("theme") ?? "auto";
  choice.addEventListener("change", () => (localStorage.setItem("theme", choice.value), apply()));
  system.addEventListener("change", apply);
  apply();
}

async function start() {
  theme();
  signOut(document.querySelector("header"));
  for (const link of document.querySelectorAll("nav a")) {
    const path = new URL(link.href).pathname;
    const is_here = path === location.pathname || (path === "/" && location.pathname.startsWith("/sweeps/"));
    if (is_here) link.setAttribute("aria-current", "page");
  }
  const main = document.getElementById("main");
  const found = PAGES.map(([pattern, name]) => [pattern.exec(location.pathname), name]).find(([match]) => match);
  try {
    const page = await import(`./pages/${found[1]}.js`);
    await page.show(main, ...found[0].slice(1));
  } catch (error) {
    main.replaceChildren(h("h1", {}, "This page cannot be shown"), h("p", { class: "fault", role: "alert" }, error.message));
    console.error(error);
  }
}

start();
