// @ts-check
// Names, intervals and marks that the pictures of studies share.

import { labelOf, number, unitSuffix } from "../../format.js";
import { responseRow } from "../../outputs.js";
import { colour } from "../plot.js";

/** Size of the mark with the most runs, in pixels, and of the smallest marks. */
const MAX_SIZE = 22, MIN_SIZE = 6;

/** @typedef {{ value: number, low: number | null, high: number | null }} WithInterval */

/**
 * The label of a measure with its unit.
 * @param {StudyMeasure} of @param {OutputTable} outputs
 */
export function measureLabel(of, outputs) {
  if ("probability" in of) return `probability of ${of.probability.replaceAll("_", " ")}`;
  return `mean of ${labelOf(of.mean, responseRow(outputs, of.mean)?.unit)}`;
}

/**
 * The label of an axis of a curve or series, such as `stress_pa`.
 * @param {string} name @param {OutputTable} outputs
 */
export function axisLabel(name, { curves, series }) {
  const axes = [...curves.flatMap((row) => [[row.name, row.unit], [row.over, row.over_unit]]), ...series.map((row) => [row.name, row.unit]), ["time", "s"]];
  const found = axes.find(([word, unit]) => word === name || word + unitSuffix(unit) === name);
  return found ? labelOf(found[0], found[1]) : name.replaceAll("_", " ");
}

/**
 * A value of a factor in words: a number, or a level.
 * @param {StudyValue} value
 */
export const valueText = (value) => (typeof value === "number" ? number(value) : String(value).replaceAll("_", " "));

/**
 * A point in words: the label and value of each factor, a line each.
 * @param {StudyFactor[]} factors @param {StudyValue[]} values
 */
export const placeText = (factors, values) => factors.map((factor, i) => `${factor.label} ${valueText(values[i])}`).join("<br>");

/**
 * An interval in words.
 * @param {Pick<WithInterval, "low" | "high"> | null | undefined} of
 */
export const intervalText = (of) => (!of || of.low === null || of.high === null ? "–" : `${number(of.low)} to ${number(of.high)}`);

/**
 * Error bars from values to both ends of their intervals.
 * @param {WithInterval[]} rows @param {string} color
 */
export function errorBars(rows, color) {
  return { type: "data", array: rows.map((row) => (row.high ?? row.value) - row.value), arrayminus: rows.map((row) => row.value - (row.low ?? row.value)), color, thickness: 1.2, width: 4 };
}

/**
 * Marks with an area in proportion to the number of runs.
 * @param {number[]} runs
 */
export const sizedByRuns = (runs) => ({ size: runs, sizemode: "area", sizeref: (2 * Math.max(1, ...runs)) / MAX_SIZE ** 2, sizemin: MIN_SIZE / 2 });

/**
 * The axis of a factor; with levels a tick for each.
 * @param {StudyFactor} factor
 */
export const factorAxis = ({ label, is_log, levels }) => ({ title: { text: label }, ...(is_log && { type: "log" }), ...(levels && { type: "category", categoryorder: "array", categoryarray: levels.map(valueText) }) });

/**
 * A column for each factor, in a table of points.
 * @param {StudyFactor[]} factors @returns {Column<any>[]}
 */
export const factorColumns = (factors) => factors.map((factor, i) => ({ title: factor.label, is_number: factor.levels === null, cell: ({ values }) => valueText(values[i]) }));

/**
 * Points along the axis of a single factor; with more factors a place for each, named by its values.
 * @param {StudyFactor[]} factors @param {{ values: StudyValue[] }[]} points
 */
export function alongPoints(factors, points) {
  if (factors.length === 1) return { x: points.map(({ values }) => (factors[0].levels ? valueText(values[0]) : values[0])), xaxis: factorAxis(factors[0]) };
  const title = { text: factors.map(({ label }) => label).join(", ") };
  return { x: points.map(({ values }) => values.map(valueText).join(", ")), xaxis: { title, type: "category" } };
}

/**
 * The whole range of a factor on its axis, with a margin as a share of it.
 * @param {StudyFactor} factor @param {number} [margin]
 */
export function wholeRange({ low, high, is_log, levels }, margin = 0) {
  if (levels) return { range: [-0.5, levels.length - 0.5] };
  const [from, to] = is_log ? [Math.log10(low), Math.log10(high)] : [low, high], beyond = margin * (to - from);
  return { range: [from - beyond, to + beyond] };
}

/**
 * A dashed line across the plot at a value of the vertical axis, with its name.
 * @param {number} y @param {string} name
 */
export function levelLine(y, name) {
  return {
    shapes: [{ type: "line", xref: "paper", x0: 0, x1: 1, y0: y, y1: y, line: { color: colour("dim"), dash: "dash", width: 1.4 } }],
    annotations: [{ text: name, xref: "paper", x: 1, xanchor: "right", y, yanchor: "bottom", showarrow: false, font: { color: colour("dim") } }],
  };
}
