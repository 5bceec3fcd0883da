// @ts-check
// A response surface: contours of a quadratic in two factors, fitted by least squares, and the points of the fit.

import { factorLabel, number } from "../format.js";
import { level } from "../measures.js";
import { table } from "../parts.js";
import { colour } from "./plot.js";
import { pointText } from "./response.js";

/** @type {((x: number, y: number) => number)[]} */
const TERMS = [() => 1, (x) => x, (_, y) => y, (x) => x * x, (x, y) => x * y, (_, y) => y * y];
/** Cells along a side of the plot. */
const CELLS = 40;

/**
 * Solves A c = b by elimination with pivoting. Null where A is singular, as with too few levels.
 * @param {number[][]} A @param {number[]} b
 */
function solve(A, b) {
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

/**
 * The quadratic of least squares through points [x, y, value], with factors scaled to −1…1, and its R².
 * @param {Vector[]} points
 */
export function quadratic(points) {
  const scale = (/** @type {number} */ i) => {
    const values = points.map((point) => point[i]), low = Math.min(...values), span = Math.max(...values) - low;
    return (/** @type {number} */ value) => (span > 0 ? (2 * (value - low)) / span - 1 : 0);
  };
  const [sx, sy] = [scale(0), scale(1)];
  const rows = points.map(([x, y]) => TERMS.map((term) => term(sx(x), sy(y))));
  const average = (/** @type {(i: number) => number} */ of) => points.reduce((total, _, i) => total + of(i), 0) / points.length;
  const c = points.length > TERMS.length ? solve(TERMS.map((_, j) => TERMS.map((_, k) => average((i) => rows[i][j] * rows[i][k]))), TERMS.map((_, j) => average((i) => rows[i][j] * points[i][2]))) : null;
  if (!c) return null;
  const at = (/** @type {number} */ x, /** @type {number} */ y) => TERMS.reduce((total, term, j) => total + c[j] * term(sx(x), sy(y)), 0);
  const mean = average((i) => points[i][2]), spread = average((i) => (points[i][2] - mean) ** 2);
  return { at, r2: spread > 0 ? 1 - average((i) => (points[i][2] - at(points[i][0], points[i][1])) ** 2) / spread : 1 };
}

/** @param {MapInput} input @returns {Plot | null} */
export function surfacePlot({ points, factors, measure, x, y, path }) {
  const rows = points.flatMap((row) => {
    const value = measure.of(row), [at, up] = [level(row.factors[x]), level(row.factors[y])];
    return value && typeof at === "number" && typeof up === "number" ? [{ row, value, x: at, y: up }] : [];
  });
  const fit = quadratic(rows.map((one) => [one.x, one.y, one.value.mean]));
  if (!fit) return null;
  const along = (/** @type {(one: (typeof rows)[number]) => number} */ pick) => {
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
        customdata: rows.map((one) => path(one.row)), text: rows.map((one) => pointText(one.row.factors, factors, `measured ${number(one.value.mean)}, fitted ${number(fit.at(one.x, one.y))}`)), hoverinfo: "text" },
    ],
    layout: { showlegend: false, xaxis: { title: { text: factorLabel(x, factors) } }, yaxis: { title: { text: factorLabel(y, factors) } },
      annotations: [{ text: `quadratic, R² ${number(fit.r2, 3)}, ${rows.length} points`, xref: "paper", yref: "paper", x: 0, y: 1.01, yanchor: "bottom", showarrow: false, font: { color: colour("dim") } }] },
    table: () => table(`${measure.label}: measured and fitted (R² ${number(fit.r2, 3)})`, [
      { title: factorLabel(x, factors), is_number: true, cell: (one) => number(one.x) }, { title: factorLabel(y, factors), is_number: true, cell: (one) => number(one.y) },
      { title: "Measured", is_number: true, cell: (one) => number(one.value.mean) }, { title: "Fitted", is_number: true, cell: (one) => number(fit.at(one.x, one.y)) },
    ], rows.slice(0, 500)),
  };
}
