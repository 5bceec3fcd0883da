// @ts-check
// Sliding: the tilt at which a fillet begins to slide, over friction, and Coulomb's angle for a block, atan μ.

import { factorLabel, number } from "../../format.js";
import { table } from "../../parts.js";
import { colour } from "../plot.js";
import { lineTrace, meanLines } from "./lines.js";

const STEPS = 40;

/** @param {PlotInput} input @returns {Plot} */
export function slidePlot({ points, factors, x, measure, ...rest }) {
  const all = meanLines({ points, factors, x, measure, ...rest }), is_friction = x.endsWith("/static_friction");
  // Over any factor but friction, each point has its own angle from its own scenario.
  const ideal = is_friction ? coulomb(all.flatMap((line) => line.x.map(Number))) : angles(points, x);
  return {
    traces: [
      ...all.map((line, i) => lineTrace(line, i, line.name === "all" ? "begins to slide" : line.name)),
      { type: "scatter", mode: is_friction ? "lines" : "markers", name: "atan μ", ...ideal, line: { color: colour("dim"), dash: "dot", width: 1.6 }, marker: { color: colour("dim"), symbol: "line-ew-open", size: 12 }, hovertemplate: "atan μ %{y:.4g}°<extra></extra>" },
    ],
    layout: { xaxis: { title: { text: factorLabel(x, factors) } }, yaxis: { title: { text: measure.label }, rangemode: "tozero" } },
    table: () => table("Angle of sliding and atan μ, in degrees", [
      { title: "Point", is_number: true, cell: (row) => row.point },
      { title: factorLabel(x, factors), is_number: true, cell: (row) => number(row.factors[x]) },
      { title: "Slides at", is_number: true, cell: (row) => number(measure.of(row)?.mean) },
      { title: "atan μ", is_number: true, cell: (row) => number(row.responses.friction_angle_deg?.mean) },
    ], points),
  };
}

/** @param {PointRow[]} points @param {string} x */
function angles(points, x) {
  const rows = points.filter((row) => typeof row.responses.friction_angle_deg?.mean === "number");
  return { x: rows.map((row) => row.factors[x]), y: rows.map((row) => row.responses.friction_angle_deg.mean) };
}

/** @param {number[]} frictions */
function coulomb(frictions) {
  const low = Math.min(...frictions), high = Math.max(...frictions);
  const x = Array.from({ length: STEPS + 1 }, (_, i) => low + ((high - low) * i) / STEPS);
  return { x, y: x.map((friction) => (180 / Math.PI) * Math.atan(friction)) };
}
