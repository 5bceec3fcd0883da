// @ts-check
// A measure over two factors: as cells where there are few levels, else as points.

import { factorLabel, number } from "../format.js";
import { level, levels } from "../measures.js";
import { h } from "../dom.js";
import { measured, pointText } from "./response.js";
import { colour } from "./plot.js";

/** Levels along a side that are drawn as cells. */
const MAX_LEVELS = 30;

/** @typedef {{ sum: number, n: number, rows: PointRow[] }} Cell */
/** @typedef {{ across: Level[], up: Level[], cells: Cell[][] }} Grid */

/**
 * Cells with the mean over all trials at two levels.
 * @param {PointRow[]} points @param {Measure} measure @param {string} x @param {string} y @returns {Grid}
 */
function cells(points, measure, x, y) {
  const [across, up] = [levels(points, x), levels(points, y)];
  const sums = up.map(() => across.map(() => /** @type {Cell} */ ({ sum: 0, n: 0, rows: [] })));
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

/**
 * The colour scale of shares or of quantities; both suit the dark and the light theme.
 * @param {Measure} measure
 */
const scaleOf = (measure) => (measure.is_share ? [[0, colour("c0")], [0.5, colour("c4")], [1, colour("c1")]] : "Viridis");

/** @param {Measure} measure */
function title(measure) {
  return { text: measure.is_share ? "share" : measure.label, side: "right" };
}

/** @param {MapInput} input @returns {Plot} */
export function mapPlot({ points, factors, measure, x, y, path }) {
  const layout = { showlegend: false, xaxis: { title: { text: factorLabel(x, factors) } }, yaxis: { title: { text: factorLabel(y, factors) } } };
  const limits = measure.is_share ? { zmin: 0, zmax: 1 } : {};
  const grid = cells(points, measure, x, y);
  const table = () => gridTable(grid, measure, factorLabel(x, factors), factorLabel(y, factors));
  if (grid.across.length <= MAX_LEVELS && grid.up.length <= MAX_LEVELS) {
    const text = (/** @type {Cell} */ cell) => (cell.n === 0 ? "" : measure.is_share ? `${Math.round(cell.sum)}/${cell.n}` : number(cell.sum / cell.n, 3));
    /**
     * @template T
     * @param {(cell: Cell) => T} work
     */
    const each = (work) => grid.cells.map((row) => row.map(work));
    // Trials of several points have no common interval.
    const interval = (/** @type {Cell} */ cell) => {
      const value = cell.rows.length === 1 ? measure.of(cell.rows[0]) : null;
      return value && value.low !== null && value.high !== null ? `<br>95 %: ${number(value.low, 3)} to ${number(value.high, 3)}` : "";
    };
    const trace = {
      type: "heatmap", x: grid.across.map(String), y: grid.up.map(String), z: each((cell) => (cell.n ? cell.sum / cell.n : null)), text: each(text), texttemplate: "%{text}", hovertext: each(interval),
      customdata: each((cell) => (cell.rows.length === 1 ? path(cell.rows[0]) : null)),
      hovertemplate: `${factorLabel(x, factors)} %{x}<br>${factorLabel(y, factors)} %{y}<br>${measure.label} %{z:.4g} (%{text})%{hovertext}<extra></extra>`,
      colorscale: scaleOf(measure), ...limits, xgap: 2, ygap: 2, colorbar: { title: title(measure), thickness: 12 },
    };
    return { traces: grid.cells.flat().some((cell) => cell.n) ? [trace] : [], layout: { ...layout, xaxis: { ...layout.xaxis, type: "category" }, yaxis: { ...layout.yaxis, type: "category" } }, table };
  }
  const rows = points.flatMap((row) => measured(row, measure));
  const marker = { size: 12, color: rows.map(({ value }) => value.mean), colorscale: scaleOf(measure), colorbar: { title: title(measure), thickness: 12 }, line: { width: 1, color: colour("dim") } };
  if (measure.is_share) Object.assign(marker, { cmin: 0, cmax: 1 });
  const trace = {
    type: "scatter", mode: "markers", marker, x: rows.map(({ row }) => level(row.factors[x])), y: rows.map(({ row }) => level(row.factors[y])),
    text: rows.map(({ row, value }) => pointText(row.factors, factors, `${measure.label} ${number(value.mean)} of ${value.n}<br>point ${row.point}: click to open its jobs`)), customdata: rows.map(({ row }) => path(row)), hoverinfo: "text",
  };
  return { traces: rows.length ? [trace] : [], layout, table };
}

/** @param {Grid} grid @param {Measure} measure @param {string} x @param {string} y */
function gridTable(grid, measure, x, y) {
  const text = (/** @type {Cell} */ cell) => (cell.n === 0 ? "–" : measure.is_share ? `${Math.round(cell.sum)} of ${cell.n}` : number(cell.sum / cell.n));
  const [across, up] = [grid.across.slice(0, 50), grid.up.slice(0, 50)];
  return h("table", {}, h("caption", {}, `${measure.label}: ${y} down, ${x} across`),
    h("thead", {}, h("tr", {}, h("td"), across.map((level) => h("th", { scope: "col", class: "number" }, number(level))))),
    h("tbody", {}, up.map((level, j) => h("tr", {}, h("th", { scope: "row" }, number(level)), across.map((_, i) => h("td", { class: "number" }, text(grid.cells[j][i])))))));
}
