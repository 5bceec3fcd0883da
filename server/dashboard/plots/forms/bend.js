// Bending: the angle over a factor, and beside it how each design point hangs, drawn as a centre line that turns evenly by that angle.

import { factor, number } from "../../format.js";
import { table } from "../../parts.js";
import { colour, series } from "../plot.js";
import { lines } from "./lines.js";

/** Real fillets bend by more than this, says the paper (section 2.3.2). */
const REAL_DEG = 120;
const STEPS = 24;

export function bendPlot({ points, factors, x, measure, path }) {
  const all = lines({ points, factors, x, measure, path });
  const ends = all[0] && [Math.min(...all.flatMap((line) => line.x)), Math.max(...all.flatMap((line) => line.x))];
  const rows = all.flatMap((line, i) => line.x.map((at, k) => ({ line, i, k, at })));
  return {
    traces: [
      ...all.map((line, i) => ({
        type: "scatter", mode: "lines+markers", name: line.name === "all" ? measure.label : line.name, legendgroup: line.name, x: line.x, y: line.mean, line: { color: series(i), width: 1.6 }, marker: { size: 8, color: series(i) },
        error_y: { type: "data", array: line.up, arrayminus: line.down, color: series(i), thickness: 1.2, width: 4 }, customdata: line.path, text: line.told, hoverinfo: "text",
      })),
      ...(typeof ends?.[0] === "number" ? [{ type: "scatter", mode: "lines", name: "real fillets bend further", x: ends, y: [REAL_DEG, REAL_DEG], line: { color: colour("dim"), dash: "dot", width: 1.6 }, hoverinfo: "skip" }] : []),
      ...rows.map(({ line, i, k }) => ({
        type: "scatter", mode: "lines", legendgroup: line.name, showlegend: false, xaxis: "x2", yaxis: "y2", ...hanging(line.mean[k]), line: { color: series(i), width: 2 },
        customdata: Array.from({ length: STEPS + 1 }, () => line.path[k]), hoverinfo: "text", text: line.told[k],
      })),
    ],
    layout: {
      xaxis: { title: { text: factor(x, factors) }, domain: [0, 0.6] }, yaxis: { title: { text: measure.label }, rangemode: "tozero" },
      xaxis2: { domain: [0.68, 1], title: { text: "as it hangs, in lengths" } }, yaxis2: { anchor: "x2", scaleanchor: "x2" },
    },
    table: () => table("Bend angle in degrees", [
      { title: "Design", cell: ({ line }) => line.name }, { title: factor(x, factors), is_number: true, cell: ({ at }) => number(at) },
      { title: "Angle", is_number: true, cell: ({ line, k }) => number(line.mean[k]) }, { title: "95 %, half", is_number: true, cell: ({ line, k }) => number(line.up[k]) },
    ], rows),
  };
}

/** A line of length 1 over a bar at its middle, whose tangent turns by so many degrees from end to end. */
function hanging(angle_deg) {
  const angle = (angle_deg * Math.PI) / 180;
  const along = Array.from({ length: STEPS + 1 }, (_, i) => i / STEPS - 0.5);
  if (Math.abs(angle) < 1e-6) return { x: along, y: along.map(() => 0) };
  return { x: along.map((s) => Math.sin(angle * s) / angle), y: along.map((s) => (Math.cos(angle * s) - 1) / angle) };
}
