// @ts-check
// Cards with plots of plotly.js, which is loaded on first use. Each has the theme's colours and, for screen readers, a table beneath.
// Use SVG traces only: WebGL traces compile code from text, which the content security policy refuses.

import { h } from "../dom.js";

/** @type {Promise<any> | undefined} */
let loading;

function plotly() {
  loading ??= new Promise((loaded, failed) => {
    const script = h("script", { src: "/dashboard/plotly.min.js", onload: () => loaded(window.Plotly) });
    script.addEventListener("error", () => failed(new Error("plotly.js could not be loaded")));
    document.head.append(script);
  });
  return loading;
}

/**
 * A colour of the theme.
 * @param {string} name
 */
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/**
 * The colour of line i; there are eight.
 * @param {number} i
 */
export const series = (i) => colour(`c${i % 8}`);

/**
 * A colour with opacity, 0 to 1.
 * @param {string} hex @param {number} opacity
 */
export const transparent = (hex, opacity) => `${hex}${Math.round(255 * opacity).toString(16).padStart(2, "0")}`;

/**
 * The axis range of shares that are all equal: plotly.js would draw 1 on an axis from 0 to 2.
 * @param {string} name @param {unknown[]} values
 */
export const shareRange = (name, values) => (name.endsWith("_fraction") && values.every((value) => value === values[0]) ? { range: [-0.03, 1.05] } : {});

/** The legend of a plot unless its layout has another: below the plot, clear of the axis title and the buttons. */
export const LEGEND = { orientation: "h", yref: "container", y: 0, yanchor: "bottom", x: 0 };

/** @param {any} layout */
function themed(layout) {
  const axis = { gridcolor: colour("line"), zerolinecolor: colour("line"), linecolor: colour("dim"), automargin: true, title: { standoff: 8 } };
  const axes = Object.fromEntries(Object.entries({ xaxis: {}, yaxis: {}, ...layout }).filter(([key]) => /^[xy]axis/.test(key))
    .map(([key, own]) => [key, { ...axis, ...own, title: { ...axis.title, ...own.title } }]));
  return {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", hovermode: "closest", showlegend: true,
    font: { color: colour("text"), family: "system-ui, sans-serif", size: 12 }, margin: { l: 56, r: 12, t: 30, b: 44 },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("dim"), activecolor: colour("text") },
    hoverlabel: { bgcolor: colour("raised"), bordercolor: colour("line"), font: { color: colour("text") }, align: "left" },
    legend: LEGEND, ...layout, ...axes,
  };
}

/**
 * A card with a plot. `draw(make)` shows the plot that `make` returns, and makes it again when the theme changes. A click on a point opens the
 * path in its `customdata`. Without traces the card shows `empty_text`, or is hidden where that is null.
 * @param {string} title @param {{ controls?: Child[], size?: string, is_wide?: boolean, empty_text?: string | null }} [options]
 */
export function panel(title, { controls = [], size = "", is_wide = false, empty_text = "No data yet." } = {}) {
  const plot = h("div", { class: `plot ${size}`, role: "img", "aria-label": title });
  const empty = h("p", { class: "dim" }, empty_text);
  const beneath = h("div", { class: "tall" }), note = h("p", { class: "dim", hidden: true });
  const details = h("details", { class: "under" }, h("summary", {}, "As a table"), beneath);
  const card = h("section", { class: is_wide ? "card whole" : "card" }, h("h2", {}, title), controls.length > 0 && h("div", { class: "row" }, controls), empty, plot, note, details);
  /** @type {(() => Plot | null | undefined) | undefined} */
  let make;
  let has_listeners = false;
  const render = async () => {
    const Plotly = await plotly();
    const drawn = make?.();
    const is_empty = !drawn || drawn.traces.length === 0;
    empty.hidden = !is_empty;
    card.hidden = is_empty && empty_text === null;
    plot.hidden = details.hidden = is_empty;
    note.hidden = is_empty || !drawn.note;
    if (is_empty) return;
    note.textContent = drawn.note ?? "";
    const config = { displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"], toImageButtonOptions: { format: "svg", filename: title } };
    await Plotly.react(plot, drawn.traces, themed(drawn.layout), config);
    if (!has_listeners) {
      has_listeners = true;
      new ResizeObserver(() => plot.clientWidth > 0 && Plotly.Plots.resize(plot)).observe(plot);
      // plotly.js adds `on` to the element.
      const clickable = /** @type {any} */ (plot);
      clickable.on("plotly_click", (/** @type {any} */ { points }) => points[0]?.customdata?.startsWith?.("/") && (location.href = points[0].customdata));
    }
    const table = () => details.open && beneath.replaceChildren(drawn.table());
    details.ontoggle = table;
    table();
  };
  addEventListener("theme", () => make && render());
  plot.hidden = details.hidden = true;
  card.hidden = empty_text === null;
  return {
    card,
    draw: (/** @type {() => Plot | null | undefined} */ next) => {
      make = next;
      return render();
    },
  };
}
