// @ts-check
// Bending: the bend angle over a factor, and beside it the centre line of each design point with constant curvature and that angle.

import { factorLabel, number } from "../../format.js";
import { table } from "../../parts.js";
import { colour, series } from "../plot.js";
import { lineTrace, meanLines } from "./lines.js";

/** Real fillets bend by more than this angle, in degrees (section 2.3.2 of the paper). */
const REAL_DEG = 120;
const STEPS = 24;

/** @param {PlotInput} input @returns {Plot} */
export function bendPlot({ factors, x, measure, ...rest }) {
  const all = meanLines({ factors, x, measure, ...rest });
  const levels = all.flatMap((line) => line.x), numbers = levels.filter((level) => typeof level === "number");
  const ends = numbers.length > 0 && numbers.length === levels.length ? [Math.min(...numbers), Math.max(...numbers)] : null;
  const rows = all.flatMap((line, i) => line.x.map((at, k) => ({ line, i, k, at })));
  return {
    traces: [
      ...all.map((line, i) => ({ ...lineTrace(line, i, line.name === "all" ? measure.label : line.name), legendgroup: line.name })),
      ...(ends ? [{ type: "scatter", mode: "lines", name: "real fillets bend more", x: ends, y: [REAL_DEG, REAL_DEG], line: { color: colour("dim"), dash: "dot", width: 1.6 }, hoverinfo: "skip" }] : []),
      ...rows.map(({ line, i, k }) => ({
        type: "scatter", mode: "lines", legendgroup: line.name, showlegend: false, xaxis: "x2", yaxis: "y2", ...centreLine(line.mean[k]), line: { color: series(i), width: 2 },
        customdata: Array.from({ length: STEPS + 1 }, () => line.path[k]), hoverinfo: "text", text: line.text[k],
      })),
    ],
    layout: {
      xaxis: { title: { text: factorLabel(x, factors) }, domain: [0, 0.6] }, yaxis: { title: { text: measure.label }, rangemode: "tozero" },
      xaxis2: { domain: [0.68, 1], title: { text: "shape, in fillet lengths" } }, yaxis2: { anchor: "x2", scaleanchor: "x2" },
    },
    table: () => table("Bend angle in degrees", [
      { title: "Design", cell: ({ line }) => line.name }, { title: factorLabel(x, factors), is_number: true, cell: ({ at }) => number(at) },
      { title: "Angle", is_number: true, cell: ({ line, k }) => number(line.mean[k]) }, { title: "95 % (±)", is_number: true, cell: ({ line, k }) => number(line.up[k]) },
    ], rows),
  };
}

/**
 * A line of length 1 that hangs over a bar at its middle, with constant curvature. Its tangent turns by the angle from end to end.
 * @param {number} angle_deg
 */
function centreLine(angle_deg) {
  const angle = (angle_deg * Math.PI) / 180;
  const along = Array.from({ length: STEPS + 1 }, (_, i) => i / STEPS - 0.5);
  if (Math.abs(angle) < 1e-6) return { x: along, y: along.map(() => 0) };
  return { x: along.map((s) => Math.sin(angle * s) / angle), y: along.map((s) => (Math.cos(angle * s) - 1) / angle) };
}
