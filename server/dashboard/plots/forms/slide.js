// Sliding: the angle at which a fillet begins to slide, over friction, beside what Coulomb's law says of a block, atan μ.

import { factor, number } from "../../format.js";
import { table } from "../../parts.js";
import { colour, series } from "../plot.js";
import { lines } from "./lines.js";

const STEPS = 40;

export function slidePlot({ points, factors, x, measure, path }) {
  const all = lines({ points, factors, x, measure, path }), is_friction = x.endsWith("/static_friction");
  const told = points.filter((row) => typeof row.responses.friction_angle_deg?.mean === "number");
  // Over anything else than friction there is one angle for each point, from its own scenario.
  const ideal = is_friction ? coulomb(all.flatMap((line) => line.x)) : { x: told.map((row) => row.factors[x]), y: told.map((row) => row.responses.friction_angle_deg.mean) };
  return {
    traces: [
      ...all.map((line, i) => ({
        type: "scatter", mode: "lines+markers", name: line.name === "all" ? "begins to slide" : line.name, x: line.x, y: line.mean, line: { color: series(i), width: 1.6 }, marker: { size: 8, color: series(i) },
        error_y: { type: "data", array: line.up, arrayminus: line.down, color: series(i), thickness: 1.2, width: 4 }, customdata: line.path, text: line.told, hoverinfo: "text",
      })),
      { type: "scatter", mode: is_friction ? "lines" : "markers", name: "atan μ", ...ideal, line: { color: colour("dim"), dash: "dot", width: 1.6 }, marker: { color: colour("dim"), symbol: "line-ew-open", size: 12 }, hovertemplate: "atan μ %{y:.4g}°<extra></extra>" },
    ],
    layout: { xaxis: { title: { text: factor(x, factors) } }, yaxis: { title: { text: measure.label }, rangemode: "tozero" } },
    table: () => table("Angle of sliding and atan μ, in degrees", [
      { title: "Point", is_number: true, cell: (row) => row.point },
      { title: factor(x, factors), is_number: true, cell: (row) => number(row.factors[x]) },
      { title: "Slides at", is_number: true, cell: (row) => number(measure.of(row)?.mean) },
      { title: "atan μ", is_number: true, cell: (row) => number(row.responses.friction_angle_deg?.mean) },
    ], points),
  };
}

function coulomb(frictions) {
  const low = Math.min(...frictions), high = Math.max(...frictions);
  const x = Array.from({ length: STEPS + 1 }, (_, i) => low + ((high - low) * i) / STEPS);
  return { x, y: x.map((friction) => (180 / Math.PI) * Math.atan(friction)) };
}
