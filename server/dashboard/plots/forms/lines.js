// @ts-check
// Means of design points as lines over one factor: a line for each combination of levels of the other factors.

import { factorLabel, number } from "../../format.js";
import { compareLevels, level } from "../../measures.js";
import { series } from "../plot.js";
import { measured, pointText } from "../response.js";

/** @typedef {ReturnType<typeof meanLines>[number]} MeanLine */

/**
 * Lines in ascending order of `x`: means, distances to both ends of the 95 % interval, and hover text and path of each point.
 * @param {PlotInput} input
 */
export function meanLines({ points, factors, x, measure, path }) {
  const others = factors.filter((pointer) => pointer !== x);
  const rows = points.flatMap((row) => measured(row, measure)).map(({ row, value }) => ({ row, value, at: level(row.factors[x]),
    name: others.map((pointer) => `${factorLabel(pointer, factors)} ${number(level(row.factors[pointer]))}`).join(", ") || "all" }));
  return [...Map.groupBy(rows, ({ name }) => name)].map(([name, all]) => {
    const sorted = all.sort((a, b) => compareLevels(a.at, b.at));
    return {
      name, rows: sorted.map(({ row }) => row), x: sorted.map(({ at }) => at), mean: sorted.map(({ value }) => value.mean),
      up: sorted.map(({ value }) => (value.high === null ? 0 : value.high - value.mean)), down: sorted.map(({ value }) => (value.low === null ? 0 : value.mean - value.low)),
      path: sorted.map(({ row }) => path(row)),
      text: sorted.map(({ row, value }) => pointText(row.factors, factors, `${measure.label} ${number(value.mean)} of ${value.n}<br>point ${row.point}: click to open its jobs`)),
    };
  });
}

/**
 * The trace of line i.
 * @param {MeanLine} line @param {number} i @param {string} [name]
 */
export function lineTrace(line, i, name = line.name) {
  const color = series(i);
  return {
    type: "scatter", mode: "lines+markers", name, x: line.x, y: line.mean, line: { color, width: 1.6 }, marker: { size: 8, color },
    error_y: { type: "data", array: line.up, arrayminus: line.down, color, thickness: 1.2, width: 4 }, customdata: line.path, text: line.text, hoverinfo: "text",
  };
}
