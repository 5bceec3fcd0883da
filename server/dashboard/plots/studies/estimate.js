// @ts-check
// Estimates at the points of the question: a picture for each measure, with 95 % intervals.

import { number } from "../../format.js";
import { table } from "../../parts.js";
import { colour, panel } from "../plot.js";
import { alongPoints, errorBars, factorColumns, intervalText, placeText } from "./labels.js";

/** @param {import("./pictures.js").PictureInput} input */
export function estimatePictures({ goal, factors, label }) {
  return goal.intervals.map((/** @type {{ of: StudyMeasure, width: number }} */ { of, width }, /** @type {number} */ i) => {
    const name = label(of), plot = panel(`Estimate: ${name}`, { is_wide: goal.intervals.length === 1 });
    return { card: plot.card, draw: (/** @type {{ points: PointEstimate[] }} */ { points }) => plot.draw(() => estimatePlot({ points, i, name, width, factors, is_share: "probability" in of })) };
  });
}

/** @param {{ points: PointEstimate[], i: number, name: string, width: number, factors: StudyFactor[], is_share: boolean }} input @returns {Plot} */
function estimatePlot({ points, i, name, width, factors, is_share }) {
  const rows = points.flatMap(({ values, measures }) => {
    const { estimated, is_narrow } = measures[i];
    return estimated ? [{ values, is_narrow, ...estimated }] : [];
  });
  const traces = [true, false].map((is_narrow) => {
    const group = rows.filter((row) => row.is_narrow === is_narrow), color = colour(is_narrow ? "c0" : "c1");
    return {
      type: "scatter", mode: "markers", name: is_narrow ? "as narrow as asked" : "wider than asked", x: alongPoints(factors, group).x, y: group.map((row) => row.value), marker: { color, size: 10, symbol: is_narrow ? "circle" : "diamond" },
      error_y: errorBars(group, color), text: group.map((row) => `${placeText(factors, row.values)}<br>${name} ${number(row.value)}, n = ${row.n}<br>95 %: ${intervalText(row)}`), hoverinfo: "text",
    };
  });
  const { xaxis } = alongPoints(factors, rows);
  return {
    traces: traces.filter((trace) => trace.x.length > 0),
    layout: { xaxis, yaxis: { title: { text: name }, ...(is_share && { range: [-0.05, 1.05] }) } },
    table: () => table(`${name}; intervals at most ${number(width)} wide are asked`, [
      ...factorColumns(factors),
      { title: "Runs", is_number: true, cell: ({ measures }) => measures[i].estimated?.n ?? 0 },
      { title: "Estimate", is_number: true, cell: ({ measures }) => number(measures[i].estimated?.value) },
      { title: "95 % interval", is_number: true, cell: ({ measures }) => intervalText(measures[i].estimated) },
      { title: "Narrow enough", cell: ({ measures, is_excluded }) => (is_excluded ? "left out" : measures[i].is_narrow ? "yes" : "no") },
    ], points),
  };
}
