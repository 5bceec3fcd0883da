// plotly.js as pages use it: loaded when first needed, in the colours of the theme, with a table beneath for who cannot see or point.
// Only traces that are drawn as SVG: those of WebGL need code from text, which the policy refuses.

import { h } from "../dom.js";

let loading = null;

function plotly() {
  loading ??= new Promise((loaded, failed) => {
    const script = h("script", { src: "/dashboard/plotly.min.js", onload: () => loaded(window.Plotly) });
    script.addEventListener("error", () => failed(new Error("plotly.js did not load")));
    document.head.append(script);
  });
  return loading;
}

/** A colour of the theme. */
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** Colours of lines, one after the other. */
export const series = (i) => colour(`c${i % 8}`);

/** A colour with opacity, 0 to 1. */
export const sheer = (hex, opacity) => `${hex}${Math.round(255 * opacity).toString(16).padStart(2, "0")}`;

/** An axis of these values, unless they are shares that are all alike: plotly.js would give 1 an axis from 0 to 2. */
export const ofShares = (name, values) => (name.endsWith("_fraction") && values.every((value) => value === values[0]) ? { range: [-0.03, 1.05] } : {});

function themed(layout) {
  const axis = { gridcolor: colour("line"), zerolinecolor: colour("line"), linecolor: colour("dim"), automargin: true, title: { standoff: 8 } };
  const axes = Object.fromEntries(Object.entries({ xaxis: {}, yaxis: {}, ...layout }).filter(([key]) => /^[xy]axis/.test(key))
    .map(([key, own]) => [key, { ...axis, ...own, title: { ...axis.title, ...own.title } }]));
  return {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", hovermode: "closest", showlegend: true,
    font: { color: colour("text"), family: "system-ui, sans-serif", size: 12 }, margin: { l: 56, r: 12, t: 30, b: 44 },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("dim"), activecolor: colour("text") },
    // Beneath, where it meets neither the axis nor the buttons.
    legend: { orientation: "h", yref: "container", y: 0, yanchor: "bottom", x: 0 },
    hoverlabel: { bgcolor: colour("raised"), bordercolor: colour("line"), font: { color: colour("text") }, align: "left" },
    ...layout, ...axes,
  };
}

/**
 * A card with a plot. `draw(make)` shows what `make()` returns, and makes it anew when the theme changes: `traces`, `layout`, `table`
 * (makes the table beneath). A click opens the `customdata` of a point, a path. With nothing to draw it says `empty`, or is not there.
 */
export function panel(title, { controls = [], size = "", whole = false, empty: told = "Nothing to draw yet." } = {}) {
  const plot = h("div", { class: `plot ${size}`, role: "img", "aria-label": title });
  const empty = h("p", { class: "dim" }, told);
  const beneath = h("div", { class: "tall" });
  const details = h("details", { class: "under" }, h("summary", {}, "As a table"), beneath);
  const card = h("section", { class: whole ? "card whole" : "card" }, h("h2", {}, title), controls.length > 0 && h("div", { class: "row" }, controls), empty, plot, details);
  let make = null, listens = false;
  const render = async () => {
    const Plotly = await plotly();
    const what = make?.();
    const is_there = Boolean(what) && what.traces.length > 0;
    empty.hidden = is_there;
    card.hidden = !is_there && told === null;
    plot.hidden = details.hidden = !is_there;
    if (!is_there) return;
    const config = { displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"], toImageButtonOptions: { format: "svg", filename: title } };
    await Plotly.react(plot, what.traces, themed(what.layout), config);
    if (!listens) {
      listens = true;
      new ResizeObserver(() => plot.clientWidth > 0 && Plotly.Plots.resize(plot)).observe(plot);
      plot.on("plotly_click", ({ points }) => points[0]?.customdata?.startsWith?.("/") && (location.href = points[0].customdata));
    }
    const table = () => details.open && beneath.replaceChildren(what.table());
    details.ontoggle = table;
    table();
  };
  addEventListener("theme", () => make && render());
  plot.hidden = details.hidden = true;
  card.hidden = told === null;
  return { card, draw: (how) => ((make = how), render()) };
}
