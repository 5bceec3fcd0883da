// Drops as in the paper's figure 11 and table 2: the share of bonds that hold, over the speed of impact, for each way to fall; where more than half
// hold, the paper calls it stable.

import { factor, number } from "../../format.js";
import { level, levels } from "../../measures.js";
import { h } from "../../dom.js";
import { colour, series } from "../plot.js";
import { lines } from "./lines.js";

const STABLE = 0.5;

export function dropPlot({ points, factors, x, measure }) {
  const all = lines({ points, factors, x, measure });
  return {
    traces: all.map((line, i) => ({
      type: "scatter", mode: "lines+markers", name: line.name, x: line.x, y: line.mean, line: { color: series(i), width: 1.6 },
      marker: { size: 9, color: series(i), symbol: line.mean.map((share) => (share > STABLE ? "circle" : "circle-open")) },
      error_y: { type: "data", array: line.up, arrayminus: line.down, color: series(i), thickness: 1.2, width: 4 },
      customdata: line.path, text: line.told, hoverinfo: "text",
    })),
    layout: {
      xaxis: { title: { text: factor(x, factors) } }, yaxis: { title: { text: "share of bonds intact" }, range: [-0.03, 1.05] },
      shapes: [{ type: "line", xref: "paper", x0: 0, x1: 1, y0: STABLE, y1: STABLE, line: { color: colour("dim"), dash: "dot", width: 1 } }],
      annotations: [{ text: "stable above", xref: "paper", x: 1, xanchor: "right", y: STABLE, yanchor: "bottom", showarrow: false, font: { color: colour("dim") } }],
    },
    table: () => grid(all, levels(points, x), factor(x, factors)),
  };
}

/** Ways to fall down, speeds across: per cent of bonds intact, with half of the 95 % interval. */
function grid(all, across, title) {
  const cell = (line, value) => {
    const i = line.x.indexOf(level(value));
    return i < 0 ? "–" : `${number(100 * line.mean[i], 3)}${line.up[i] > 0 ? ` ± ${number(100 * line.up[i], 2)}` : ""}`;
  };
  return h("table", {}, h("caption", {}, `Bonds intact in per cent, over ${title}`),
    h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Design"), across.map((value) => h("th", { scope: "col", class: "number" }, number(value))))),
    h("tbody", {}, all.map((line) => h("tr", {}, h("th", { scope: "row" }, line.name), across.map((value) => h("td", { class: "number" }, cell(line, value)))))));
}
