// @ts-check
// Sensitivity: first-order and total Sobol' indices of each factor, or mean absolute effects, with 95 % intervals.

import { factorLabel, number } from "../../format.js";
import { table } from "../../parts.js";
import { colour, panel } from "../plot.js";
import { errorBars, intervalText } from "./labels.js";

/** @param {import("./pictures.js").PictureInput} input */
export function sensitivityPictures({ goal, factors, label }) {
  const pointers = factors.map(({ pointer }) => pointer);
  return goal.of.map((/** @type {StudyMeasure} */ of, /** @type {number} */ i) => {
    const name = label(of), plot = panel(`Sensitivity: ${name}`, { is_wide: goal.of.length === 1, empty_text: "It does not vary by more than its noise so far." });
    return {
      card: plot.card,
      draw: (/** @type {SensitivityFinding} */ { measures }) => plot.draw(() => {
        const effects = measures[i]?.effects;
        if (!effects) return null;
        return "sobol" in effects ? sobolPlot(effects.sobol, name, pointers) : morrisPlot(effects.morris, name, pointers);
      }),
    };
  });
}

/**
 * Bars of a value for each factor, the first one at the top.
 * @param {string} name @param {string[]} y @param {Estimated[]} rows @param {string} color
 */
function bars(name, y, rows, color) {
  return {
    type: "bar", orientation: "h", name, y, x: rows.map(({ value }) => value), marker: { color }, error_x: errorBars(rows, colour("text")),
    hovertext: rows.map((row, i) => `${y[i]}: ${name} ${number(row.value)}<br>95 %: ${intervalText(row)}`), hoverinfo: "text",
  };
}

const yaxis = { automargin: true, autorange: "reversed" };

/** @param {SobolIndices[]} all @param {string} name @param {string[]} pointers @returns {Plot} */
function sobolPlot(all, name, pointers) {
  const rows = [...all].sort((a, b) => b.total.value - a.total.value), title = ({ factor = "" }) => factorLabel(factor, pointers), y = rows.map(title);
  return {
    traces: [bars("first-order index", y, rows.map((row) => row.first_order), colour("c0")), bars("total index", y, rows.map((row) => row.total), colour("c1"))],
    layout: { barmode: "group", xaxis: { title: { text: "share of the variance" } }, yaxis },
    table: () => table(`Sobol' indices of ${name}`, [
      { title: "Factor", cell: title },
      { title: "First-order index", is_number: true, cell: (row) => number(row.first_order.value) }, { title: "95 % interval", is_number: true, cell: (row) => intervalText(row.first_order) },
      { title: "Total index", is_number: true, cell: (row) => number(row.total.value) }, { title: "95 % interval", is_number: true, cell: (row) => intervalText(row.total) },
    ], rows),
    note: "The first-order index is the share that the factor explains alone; the total index includes its interactions.",
  };
}

/** @param {MorrisEffects[]} all @param {string} name @param {string[]} pointers @returns {Plot} */
function morrisPlot(all, name, pointers) {
  const rows = [...all].sort((a, b) => b.mu_star.value - a.mu_star.value), title = ({ factor = "" }) => factorLabel(factor, pointers), y = rows.map(title);
  const floors = rows.flatMap((row) => (row.noise_floor === null ? [] : [{ y: title(row), x: row.noise_floor }]));
  return {
    traces: [
      bars("mean absolute effect", y, rows.map((row) => row.mu_star), colour("c0")),
      ...(floors.length > 0 ? [{ type: "scatter", mode: "markers", name: "from noise alone", y: floors.map((one) => one.y), x: floors.map((one) => one.x), marker: { color: colour("text"), symbol: "line-ns-open", size: 18, line: { width: 2 } }, hovertemplate: "noise alone: %{x:.4g}<extra></extra>" }] : []),
    ],
    layout: { xaxis: { title: { text: `change of ${name} over the range of the factor` } }, yaxis },
    table: () => table(`Elementary effects on ${name}`, [
      { title: "Factor", cell: title }, { title: "Mean absolute effect", is_number: true, cell: (row) => number(row.mu_star.value) }, { title: "95 % interval", is_number: true, cell: (row) => intervalText(row.mu_star) },
      { title: "Mean effect", is_number: true, cell: (row) => number(row.mu) }, { title: "Standard deviation", is_number: true, cell: (row) => number(row.sigma) }, { title: "From noise alone", is_number: true, cell: (row) => number(row.noise_floor) },
      { title: "Has an effect", cell: (row) => (row.has_effect === null ? "–" : row.has_effect ? "yes" : "no") },
    ], rows),
  };
}
