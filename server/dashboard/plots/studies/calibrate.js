// @ts-check
// A calibration: samples of the parameters in pairs, and simulated against measured numbers.

import { number } from "../../format.js";
import { table } from "../../parts.js";
import { colour, panel } from "../plot.js";

/** @param {import("./pictures.js").PictureInput} input */
export function calibratePictures({ factors }) {
  const samples = panel("Parameters", { is_wide: true, size: "tall-plot", empty_text: "Too few runs have ended." });
  const compared = panel("Simulated and measured", { is_wide: true, empty_text: "Too few runs have ended." });
  return [
    { card: samples.card, draw: (/** @type {CalibrateFinding} */ found) => samples.draw(() => (found.parameters.length > 0 ? samplesPlot(found, factors) : null)) },
    { card: compared.card, draw: (/** @type {CalibrateFinding} */ found) => compared.draw(() => (found.targets.some((row) => row.simulated) ? comparedPlot(found) : null)) },
  ];
}

/**
 * Histograms on the diagonal, samples below it.
 * @param {CalibrateFinding} found @param {StudyFactor[]} factors @returns {Plot}
 */
function samplesPlot({ parameters, samples }, factors) {
  const /** @type {any[]} */ traces = [], /** @type {Record<string, any>} */ axes = {}, count = parameters.length, gap = 0.06 / count;
  const title = (/** @type {number} */ i) => ({ text: factors[i].label, font: { size: 11 } });
  const column = (/** @type {number} */ i) => samples.map((sample) => sample[i]);
  for (let row = 0; row < count; row++) {
    for (let left = 0; left <= row; left++) {
      const end = traces.length === 0 ? "" : String(row * count + left + 1), x = `x${end}`, y = `y${end}`, is_histogram = row === left;
      traces.push(is_histogram
        ? { type: "histogram", x: column(row), marker: { color: colour("c0") }, nbinsx: 24, xaxis: x, yaxis: y, showlegend: false, hovertemplate: "%{x}: %{y} samples<extra></extra>" }
        : { type: "scatter", mode: "markers", x: column(left), y: column(row), marker: { color: colour("c0"), size: 3, opacity: 0.35 }, xaxis: x, yaxis: y, showlegend: false, hoverinfo: "skip" });
      if (!is_histogram) {
        traces.push({ type: "scatter", mode: "markers", name: "most probable set", x: [parameters[left].best], y: [parameters[row].best], marker: { color: colour("c1"), size: 11, symbol: "x" }, xaxis: x, yaxis: y, showlegend: row === 1 && left === 0 });
      }
      const is_last = row === count - 1, scale = (/** @type {number} */ i) => (factors[i].is_log && !is_histogram ? { type: "log" } : {});
      axes[`xaxis${end}`] = { domain: [left / count + gap, (left + 1) / count - gap], anchor: y, showticklabels: is_last, nticks: 5, ...scale(left), ...(is_last && { title: title(left) }) };
      axes[`yaxis${end}`] = { domain: [1 - (row + 1) / count + gap, 1 - row / count - gap], anchor: x, nticks: 5, ...scale(row), ...(is_histogram ? { showticklabels: false } : left === 0 && { title: title(row) }) };
    }
  }
  return {
    traces, layout: { ...axes, height: 120 + 150 * count },
    table: () => table("Parameters with their 95 % intervals", [
      { title: "Parameter", cell: (row) => factors[parameters.indexOf(row)].label }, { title: "Mean", is_number: true, cell: ({ estimate }) => number(estimate.mean) },
      { title: "95 % interval", is_number: true, cell: ({ estimate }) => `${number(estimate.low)} to ${number(estimate.high)}` }, { title: "Most probable set", is_number: true, cell: ({ best }) => number(best) },
      { title: "Remaining share of the prior's deviation", is_number: true, cell: ({ remaining }) => number(remaining) },
    ], parameters),
    note: "Every dot is a set of parameters that agrees with the measurements, as often as it is probable.",
  };
}

/** @param {CalibrateFinding} found @returns {Plot} */
function comparedPlot({ targets }) {
  const title = (/** @type {TargetAgreement} */ { target }) => `${target.test}: ${Object.values(target.of)[0]}`;
  const rows = targets.filter(({ simulated, target }) => simulated && target.mean !== 0), y = rows.map(title);
  const bars = (/** @type {number[]} */ width, thickness = 2) => ({ type: "data", array: width, thickness, width: 0 });
  const relative = rows.map(({ simulated, target }) => ["mean", "low", "high"].map((name) => /** @type {any} */ (simulated)[name] / target.mean));
  return {
    traces: [
      { type: "scatter", mode: "markers", name: "measured, mean ± 2 standard errors", y, x: rows.map(() => 1), marker: { color: colour("c1"), size: 12 }, error_x: bars(rows.map(({ target }) => (2 * target.deviation) / Math.sqrt(target.n) / Math.abs(target.mean)), 8), opacity: 0.6, hoverinfo: "y" },
      { type: "scatter", mode: "markers", name: "simulated, 95 %", y, x: relative.map(([mean]) => mean), marker: { color: colour("c0"), size: 8 }, error_x: { ...bars(relative.map(([mean, , high]) => high - mean)), symmetric: false, arrayminus: relative.map(([mean, low]) => mean - low) }, hoverinfo: "y" },
    ],
    layout: { xaxis: { title: { text: "relative to the measured mean" } }, yaxis: { automargin: true, autorange: "reversed" } },
    table: () => table("Simulated and measured numbers", [
      { title: "Number", cell: title }, { title: "Measured", is_number: true, cell: ({ target }) => number(target.mean) }, { title: "Standard deviation", is_number: true, cell: ({ target }) => number(target.deviation) }, { title: "n", is_number: true, cell: ({ target }) => number(target.n) },
      { title: "Simulated", is_number: true, cell: ({ simulated }) => number(simulated?.mean ?? null) }, { title: "95 % interval", is_number: true, cell: ({ simulated }) => (simulated ? `${number(simulated.low)} to ${number(simulated.high)}` : "–") },
      { title: "Distance in standard deviations", is_number: true, cell: ({ distance }) => number(distance) },
    ], targets),
  };
}
