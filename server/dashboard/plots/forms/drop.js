// @ts-check
// Drops: the share of intact bonds over the impact speed, with a line for each orientation (figure 11 and table 2 of the paper). The paper
// calls a fillet stable when more than half of its bonds are intact.

import { factorLabel, number } from "../../format.js";
import { level, levels } from "../../measures.js";
import { h } from "../../dom.js";
import { colour, series } from "../plot.js";
import { lineTrace, meanLines } from "./lines.js";

const STABLE = 0.5;

/** @param {PlotInput} input @returns {Plot} */
export function dropPlot({ points, factors, x, ...rest }) {
  const all = meanLines({ points, factors, x, ...rest });
  return {
    traces: all.map((line, i) => ({
      ...lineTrace(line, i), marker: { size: 9, color: series(i), symbol: line.mean.map((share) => (share > STABLE ? "circle" : "circle-open")) },
    })),
    layout: {
      xaxis: { title: { text: factorLabel(x, factors) } }, yaxis: { title: { text: "share of bonds intact" }, range: [-0.03, 1.05] },
      shapes: [{ type: "line", xref: "paper", x0: 0, x1: 1, y0: STABLE, y1: STABLE, line: { color: colour("dim"), dash: "dot", width: 1 } }],
      annotations: [{ text: "stable above", xref: "paper", x: 1, xanchor: "right", y: STABLE, yanchor: "bottom", showarrow: false, font: { color: colour("dim") } }],
    },
    table: () => grid(all, levels(points, x), factorLabel(x, factors)),
  };
}

/**
 * Rows of designs and columns of speeds: per cent of bonds intact ± half of the 95 % interval.
 * @param {import("./lines.js").MeanLine[]} all @param {Level[]} across @param {string} title
 */
function grid(all, across, title) {
  const cell = (/** @type {import("./lines.js").MeanLine} */ line, /** @type {Level} */ value) => {
    const i = line.x.indexOf(level(value));
    return i < 0 ? "–" : `${number(100 * line.mean[i], 3)}${line.up[i] > 0 ? ` ± ${number(100 * line.up[i], 2)}` : ""}`;
  };
  return h("table", {}, h("caption", {}, `Bonds intact in per cent, over ${title}`),
    h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Design"), across.map((value) => h("th", { scope: "col", class: "number" }, number(value))))),
    h("tbody", {}, all.map((line) => h("tr", {}, h("th", { scope: "row" }, line.name), across.map((value) => h("td", { class: "number" }, cell(line, value)))))));
}
