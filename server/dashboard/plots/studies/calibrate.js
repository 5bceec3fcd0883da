// @ts-check
// A calibration: samples of the parameters in pairs, and simulated against measured numbers and curves.

import { number } from "../../format.js";
import { table } from "../../parts.js";
import { colour, panel, transparent } from "../plot.js";

/** @param {import("./pictures.js").PictureInput} input */
export function calibratePictures({ factors, axisLabel }) {
  const samples = panel("Parameters", { is_wide: true, size: "tall-plot", empty_text: "Too few runs have ended." });
  const compared = panel("Simulated and measured", { is_wide: true, empty_text: "No single number was measured, or too few runs have ended." });
  const curves = panel("Simulated and measured curves", { is_wide: true, empty_text: "No curve was measured, or too few runs have ended." });
  return [
    { card: samples.card, draw: (/** @type {CalibrateFinding} */ found) => samples.draw(() => (found.parameters.length > 0 ? samplesPlot(found, factors) : null)) },
    { card: compared.card, draw: (/** @type {CalibrateFinding} */ found) => compared.draw(() => (comparedOf(found).length > 0 ? comparedPlot(found) : null)) },
    { card: curves.card, draw: (/** @type {CalibrateFinding} */ found) => curves.draw(() => (curvesOf(found).length > 0 ? curvesPlot(curvesOf(found), axisLabel) : null)) },
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
        : { type: "scatter", mode: "markers", x: column(left), y: column(row), marker: { color: colour("c0"), size: 2.5 }, xaxis: x, yaxis: y, showlegend: false, hoverinfo: "skip" });
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
      { title: "Share of the uncertainty before the tests", is_number: true, cell: ({ remaining }) => number(remaining) },
    ], parameters),
    note: "Every dot is a set of parameters that agrees with the measurements, as often as it is probable.",
  };
}

/**
 * The numbers beside curves that were measured and simulated.
 * @param {CalibrateFinding} found
 */
const comparedOf = ({ targets }) => targets.filter(({ simulated, target }) => simulated && target.mean !== 0 && !target.curve);

/** @param {CalibrateFinding} found @returns {Plot} */
function comparedPlot(found) {
  const title = (/** @type {TargetAgreement} */ { target }) => `${target.test}: ${Object.values(target.of)[0]}`;
  const rows = comparedOf(found), y = rows.map(title);
  const bars = (/** @type {number[]} */ width, thickness = 2) => ({ type: "data", array: width, thickness, width: 0 });
  const relative = rows.map(({ simulated, target }) => ["mean", "low", "high"].map((name) => /** @type {any} */ (simulated)[name] / target.mean));
  return {
    traces: [
      { type: "scatter", mode: "markers", name: "measured, mean ± 2 standard errors", y, x: rows.map(() => 1), marker: { color: colour("c1"), size: 12 }, error_x: bars(rows.map(({ target }) => (2 * target.deviation) / Math.sqrt(target.n) / Math.abs(target.mean)), 8), hoverinfo: "y" },
      { type: "scatter", mode: "markers", name: "simulated, 95 %", y, x: relative.map(([mean]) => mean), marker: { color: colour("c0"), size: 8 }, error_x: { ...bars(relative.map(([mean, , high]) => high - mean)), symmetric: false, arrayminus: relative.map(([mean, low]) => mean - low) }, hoverinfo: "y" },
    ],
    layout: { xaxis: { title: { text: "relative to the measured mean" } }, yaxis: { automargin: true, autorange: "reversed" } },
    table: () => table("Simulated and measured numbers", [
      { title: "Number", cell: title }, { title: "Measured", is_number: true, cell: ({ target }) => number(target.mean) }, { title: "Standard deviation", is_number: true, cell: ({ target }) => number(target.deviation) }, { title: "n", is_number: true, cell: ({ target }) => number(target.n) },
      { title: "Simulated", is_number: true, cell: ({ simulated }) => number(simulated?.mean ?? null) }, { title: "95 % interval", is_number: true, cell: ({ simulated }) => (simulated ? `${number(simulated.low)} to ${number(simulated.high)}` : "–") },
      { title: "Distance in standard deviations", is_number: true, cell: ({ distance }) => number(distance) },
    ], found.targets),
  };
}

/**
 * The curves that were measured and simulated: the points of each, along it.
 * @param {CalibrateFinding} found @returns {TargetAgreement[][]}
 */
function curvesOf({ targets }) {
  const /** @type {Map<string, TargetAgreement[]>} */ curves = new Map();
  for (const point of targets.filter(({ target, simulated }) => target.curve && simulated)) {
    const name = `${point.target.test}: ${point.target.curve?.name}`;
    curves.set(name, [...(curves.get(name) ?? []), point]);
  }
  return [...curves.values()].map((curve) => curve.sort((one, other) => placeOf(one) - placeOf(other)));
}

/** @param {TargetAgreement} of */
const placeOf = ({ target }) => target.curve?.at ?? 0;

/**
 * A plot for each curve, side by side: measured points with the simulated band.
 * @param {TargetAgreement[][]} curves @param {(name: string) => string} axisLabel @returns {Plot}
 */
function curvesPlot(curves, axisLabel) {
  const /** @type {any[]} */ traces = [], /** @type {Record<string, any>} */ axes = {}, columns = Math.min(2, curves.length), rows = Math.ceil(curves.length / columns);
  curves.forEach((curve, index) => {
    const end = index === 0 ? "" : String(index + 1), axis = { xaxis: `x${end}`, yaxis: `y${end}`, x: curve.map(placeOf) }, [of, along] = (curve[0].target.curve?.name ?? "").split("@");
    const simulated = (/** @type {"mean" | "low" | "high"} */ name) => curve.map((point) => point.simulated?.[name]);
    const band = { ...axis, type: "scatter", mode: "lines", line: { width: 0 }, showlegend: false, hoverinfo: "skip" };
    traces.push({ ...band, y: simulated("low") }, { ...band, y: simulated("high"), fill: "tonexty", fillcolor: transparent(colour("c0"), 0.25) });
    traces.push({ ...axis, type: "scatter", mode: "lines", name: "simulated, 95 %", y: simulated("mean"), line: { color: colour("c0") }, showlegend: index === 0 });
    traces.push({ ...axis, type: "scatter", mode: "markers", name: "measured, mean ± 2 standard errors", y: curve.map(({ target }) => target.mean), marker: { color: colour("c1"), size: 9 },
      error_y: { type: "data", array: curve.map(({ target }) => (2 * target.deviation) / Math.sqrt(target.n)), color: colour("c1") }, showlegend: index === 0 });
    const column = index % columns, row = Math.floor(index / columns), gap = 0.07;
    axes[`xaxis${end}`] = { domain: [column / columns + (column && gap), (column + 1) / columns - (column < columns - 1 ? gap / 2 : 0)], anchor: axis.yaxis, title: { text: axisLabel(along) } };
    axes[`yaxis${end}`] = { domain: [1 - (row + 1) / rows + gap, 1 - row / rows - gap / 2], anchor: axis.xaxis, title: { text: `${curve[0].target.test}: ${axisLabel(of)}` } };
  });
  return {
    traces, layout: { ...axes, height: 80 + 300 * rows },
    table: () => table("Points of the curves", [
      { title: "Test", cell: ({ target }) => target.test }, { title: "Quantity", cell: ({ target }) => axisLabel((target.curve?.name ?? "").split("@")[0]) }, { title: "At", is_number: true, cell: (row) => number(placeOf(row)) },
      { title: "Measured", is_number: true, cell: ({ target }) => number(target.mean) }, { title: "Simulated", is_number: true, cell: ({ simulated }) => number(simulated?.mean ?? null) },
      { title: "95 % interval", is_number: true, cell: ({ simulated }) => (simulated ? `${number(simulated.low)} to ${number(simulated.high)}` : "–") },
    ], curves.flat()),
  };
}
