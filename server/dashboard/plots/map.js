// A measure over two factors: where every pair of levels has been run as cells, else as points. Over the share of trials that jam this is
// the map of regimes.

import { factor, number } from "../format.js";
import { level, levels } from "../measures.js";
import { h } from "../dom.js";
import { told } from "./response.js";
import { colour } from "./plot.js";

/** More levels than this along a side, and cells say less than points. */
const MOST_LEVELS = 30;

/** Cells that average over all other factors, trial by trial. */
function cells(points, measure, x, y) {
  const [across, up] = [levels(points, x), levels(points, y)];
  const sums = up.map(() => across.map(() => ({ sum: 0, n: 0, rows: [] })));
  for (const row of points) {
    const value = measure.of(row);
    if (!value) continue;
    const cell = sums[up.indexOf(level(row.factors[y]))][across.indexOf(level(row.factors[x]))];
    cell.sum += value.n * value.mean;
    cell.n += value.n;
    cell.rows.push(row);
  }
  return { across, up, cells: sums };
}

/** Colours of shares and of quantities; both read from dark to light or back on either ground. */
const scaleOf = (measure) => (measure.is_share ? [[0, colour("c0")], [0.5, colour("c4")], [1, colour("c1")]] : "Viridis");

function title(measure) {
  return { text: measure.is_share ? "share" : measure.label, side: "right" };
}

export function mapPlot({ points, factors, measure, x, y, path }) {
  const layout = { showlegend: false, xaxis: { title: { text: factor(x, factors) } }, yaxis: { title: { text: factor(y, factors) } } };
  const limits = measure.is_share ? { zmin: 0, zmax: 1 } : {};
  const grid = cells(points, measure, x, y);
  const table = () => gridTable(grid, measure, factor(x, factors), factor(y, factors));
  if (grid.across.length <= MOST_LEVELS && grid.up.length <= MOST_LEVELS) {
    const told = (cell) => (cell.n === 0 ? "" : measure.is_share ? `${Math.round(cell.sum)}/${cell.n}` : number(cell.sum / cell.n, 3));
    const each = (tell) => grid.cells.map((row) => row.map(tell));
    const trace = {
      type: "heatmap", x: grid.across.map(String), y: grid.up.map(String), z: each((cell) => (cell.n ? cell.sum / cell.n : null)), text: each(told), texttemplate: "%{text}",
      customdata: each((cell) => (cell.rows.length === 1 ? path(cell.rows[0]) : null)),
      hovertemplate: `${factor(x, factors)} %{x}<br>${factor(y, factors)} %{y}<br>${measure.label} %{z:.4g} (%{text})<extra></extra>`,
      colorscale: scaleOf(measure), ...limits, xgap: 2, ygap: 2, colorbar: { title: title(measure), thickness: 12 },
    };
    return { traces: grid.cells.flat().some((cell) => cell.n) ? [trace] : [], layout: { ...layout, xaxis: { ...layout.xaxis, type: "category" }, yaxis: { ...layout.yaxis, type: "category" } }, table };
  }
  const rows = points.map((row) => ({ row, value: measure.of(row) })).filter(({ value }) => value);
  const marker = { size: 12, color: rows.map(({ value }) => value.mean), colorscale: scaleOf(measure), colorbar: { title: title(measure), thickness: 12 }, line: { width: 1, color: colour("dim") } };
  if (measure.is_share) Object.assign(marker, { cmin: 0, cmax: 1 });
  const trace = {
    type: "scatter", mode: "markers", marker, x: rows.map(({ row }) => level(row.factors[x])), y: rows.map(({ row }) => level(row.factors[y])),
    text: rows.map(({ row, value }) => told(row.factors, factors, `${measure.label} ${number(value.mean)} of ${value.n}<br>point ${row.point}: click for its jobs`)), customdata: rows.map(({ row }) => path(row)), hoverinfo: "text",
  };
  return { traces: rows.length ? [trace] : [], layout, table };
}

function gridTable(grid, measure, x, y) {
  const told = (cell) => (cell.n === 0 ? "–" : measure.is_share ? `${Math.round(cell.sum)} of ${cell.n}` : number(cell.sum / cell.n));
  const [across, up] = [grid.across.slice(0, 50), grid.up.slice(0, 50)];
  return h("table", {}, h("caption", {}, `${measure.label}: ${y} down, ${x} across`),
    h("thead", {}, h("tr", {}, h("td"), across.map((level) => h("th", { scope: "col", class: "number" }, number(level))))),
    h("tbody", {}, up.map((level, j) => h("tr", {}, h("th", { scope: "row" }, number(level)), across.map((_, i) => h("td", { class: "number" }, told(grid.cells[j][i])))))));
}
