// A response surface: the quadratic of least squares in two factors, as contours, under the points that it was fitted to.

import { factor, number } from "../format.js";
import { level } from "../measures.js";
import { table } from "../parts.js";
import { colour } from "./plot.js";
import { told } from "./response.js";

const TERMS = [() => 1, (x) => x, (_, y) => y, (x) => x * x, (x, y) => x * y, (_, y) => y * y];
/** Cells along a side of the drawing. */
const CELLS = 40;

/** Solves A c = b by elimination with pivots; nothing where A is singular, as with too few levels. */
function solved(A, b) {
  const rows = A.map((row, i) => [...row, b[i]]), n = b.length;
  for (let i = 0; i < n; i++) {
    const best = rows.slice(i).reduce((best, row, k) => (Math.abs(row[i]) > Math.abs(rows[best][i]) ? i + k : best), i);
    [rows[i], rows[best]] = [rows[best], rows[i]];
    if (Math.abs(rows[i][i]) < 1e-9) return null;
    for (let k = 0; k < n; k++) {
      if (k === i) continue;
      const times = rows[k][i] / rows[i][i];
      rows[k] = rows[k].map((value, j) => value - times * rows[i][j]);
    }
  }
  return rows.map((row, i) => row[n] / row[i]);
}

/** The quadratic through points [x, y, value] with factors scaled to −1 to 1, and its R². */
export function quadratic(points) {
  const scale = (i) => {
    const values = points.map((point) => point[i]), low = Math.min(...values), span = Math.max(...values) - low;
    return (value) => (span > 0 ? (2 * (value - low)) / span - 1 : 0);
  };
  const [sx, sy] = [scale(0), scale(1)];
  const rows = points.map(([x, y]) => TERMS.map((term) => term(sx(x), sy(y))));
  const sum = (of) => points.reduce((total, _, i) => total + of(i), 0) / points.length;
  const c = points.length > TERMS.length ? solved(TERMS.map((_, j) => TERMS.map((_, k) => sum((i) => rows[i][j] * rows[i][k]))), TERMS.map((_, j) => sum((i) => rows[i][j] * points[i][2]))) : null;
  if (!c) return null;
  const at = (x, y) => TERMS.reduce((total, term, j) => total + c[j] * term(sx(x), sy(y)), 0);
  const mean = sum((i) => points[i][2]), spread = sum((i) => (points[i][2] - mean) ** 2);
  return { at, r2: spread > 0 ? 1 - sum((i) => (points[i][2] - at(points[i][0], points[i][1])) ** 2) / spread : 1 };
}

export function surfacePlot({ points, factors, measure, x, y, path }) {
  const rows = points.map((row) => ({ row, value: measure.of(row), x: level(row.factors[x]), y: level(row.factors[y]) }))
    .filter((one) => one.value && typeof one.x === "number" && typeof one.y === "number");
  const fit = quadratic(rows.map((one) => [one.x, one.y, one.value.mean]));
  if (!fit) return null;
  const along = (pick) => {
    const values = rows.map(pick), low = Math.min(...values), high = Math.max(...values);
    return Array.from({ length: CELLS + 1 }, (_, i) => low + ((high - low) * i) / CELLS);
  };
  const [across, up] = [along((one) => one.x), along((one) => one.y)];
  const means = rows.map((one) => one.value.mean), all = [...means, ...up.flatMap((b) => across.map((a) => fit.at(a, b)))];
  const [low, high] = [Math.min(...all), Math.max(...all)];
  return {
    traces: [
      { type: "contour", x: across, y: up, z: up.map((b) => across.map((a) => fit.at(a, b))), zmin: low, zmax: high, colorscale: "Viridis", line: { width: 0.6 }, colorbar: { thickness: 12, title: { text: measure.label, side: "right" } },
        hovertemplate: `fitted %{z:.4g}<extra></extra>` },
      { type: "scatter", mode: "markers", x: rows.map((one) => one.x), y: rows.map((one) => one.y), marker: { size: 9, color: means, cmin: low, cmax: high, colorscale: "Viridis", line: { width: 1.5, color: colour("raised") } },
        customdata: rows.map((one) => path(one.row)), text: rows.map((one) => told(one.row.factors, factors, `measured ${number(one.value.mean)}, fitted ${number(fit.at(one.x, one.y))}`)), hoverinfo: "text" },
    ],
    layout: { showlegend: false, xaxis: { title: { text: factor(x, factors) } }, yaxis: { title: { text: factor(y, factors) } },
      annotations: [{ text: `quadratic, R² ${number(fit.r2, 3)}, ${rows.length} points`, xref: "paper", yref: "paper", x: 0, y: 1.01, yanchor: "bottom", showarrow: false, font: { color: colour("dim") } }] },
    table: () => table(`${measure.label}: measured and fitted (R² ${number(fit.r2, 3)})`, [
      { title: factor(x, factors), is_number: true, cell: (one) => number(one.x) }, { title: factor(y, factors), is_number: true, cell: (one) => number(one.y) },
      { title: "Measured", is_number: true, cell: (one) => number(one.value.mean) }, { title: "Fitted", is_number: true, cell: (one) => number(fit.at(one.x, one.y)) },
    ], rows.slice(0, 500)),
  };
}
