// @ts-check
// Curves: of one job as lines, or of a sweep as the mean of each design point in the band of its replicates.

import { number, labelOf } from "../format.js";
import { table } from "../parts.js";
import { series, shareRange, transparent } from "./plot.js";

/**
 * Series and curves of a result.
 * @param {RunResult} result @returns {(Series | Curve)[]}
 */
export const curvesOf = (result) => [...result.series, ...(result.curves ?? [])];

/**
 * Identifies a series or curve: the same quantity may be given over time and over another quantity.
 * @param {Series | Curve} data
 */
export const curveKey = (data) => `${data.name} over ${"over" in data ? data.over : "time"}`;

/** @param {Series | Curve} data */
const abscissa = (data) => ("t_s" in data ? data.t_s : data.x);

/**
 * The same series or curve of one or more jobs: as lines, or as dots, one for each body.
 * @param {Line[]} lines @param {boolean} is_per_body @returns {Plot}
 */
export function linePlot(lines, is_per_body) {
  const first = lines[0]?.data;
  if (!first) return { traces: [], layout: {}, table: () => "" };
  const across = "t_s" in first ? "belt time (s)" : labelOf(first.over, first.over_unit);
  return {
    traces: lines.map(({ name, data, path }, i) => ({
      type: "scatter", mode: is_per_body ? "markers" : "lines", name, x: abscissa(data), y: data.values, line: { color: series(i), width: 1.6 },
      customdata: path && data.values.map(() => path), hovertemplate: `%{x:.4g}, %{y:.4g}<extra>${name}</extra>`,
    })),
    layout: { showlegend: lines.length > 1, xaxis: { title: { text: across } }, yaxis: { title: { text: labelOf(first.name, first.unit) }, ...shareRange(first.name, lines.flatMap(({ data }) => data.values)) } },
    table: () => table(labelOf(first.name, first.unit), [
      { title: across, is_number: true, cell: (i) => number(abscissa(first)[i]) },
      ...lines.map(({ name, data }) => ({ title: name, is_number: true, cell: (/** @type {number} */ i) => number(data.values[i]) })),
    ], first.values.map((_, i) => i).slice(0, 400)),
  };
}

/**
 * The value of a sampled curve at time t, interpolated. Null before the first sample; after the last one, null or, with `is_constant`, the last value.
 * @param {Replicate} replicate @param {number} t @param {boolean} is_constant
 */
function valueAt({ t_s, values }, t, is_constant) {
  if (t_s.length === 0 || t < t_s[0]) return null;
  if (t > t_s[t_s.length - 1]) return is_constant ? values[values.length - 1] : null;
  let low = 0, high = t_s.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t_s[middle] <= t) low = middle;
    else high = middle;
  }
  const share = high === low ? 0 : (t - t_s[low]) / (t_s[high] - t_s[low]);
  return values[low] + share * (values[high] - values[low]);
}

/**
 * The replicates of a mean: those that have ended, or the running ones before any has ended.
 * @param {Replicate[]} replicates
 */
function averaged(replicates) {
  const ended = replicates.filter((one) => !one.partial);
  return ended.length ? ended : replicates;
}

/** @param {number[]} values */
const meanOf = (values) => values.reduce((a, b) => a + b, 0) / values.length;

/**
 * Mean, minimum and maximum of replicates at the times of the longest one, where all of them have a value. A mean of fewer would jump where one ends.
 * @param {Replicate[]} replicates @param {boolean} is_constant
 */
function band(replicates, is_constant) {
  /** @type {number[]} */
  const none = [];
  const longest = replicates.reduce((longest, { t_s }) => ((t_s.at(-1) ?? -Infinity) > (longest.at(-1) ?? -Infinity) ? t_s : longest), none);
  const common = longest.map((t) => ({ t, values: replicates.map((one) => valueAt(one, t, is_constant && !one.partial)).filter((value) => value !== null) }))
    .filter(({ values }) => values.length === replicates.length);
  return {
    t_s: common.map(({ t }) => t), mean: common.map(({ values }) => meanOf(values)),
    low: common.map(({ values }) => Math.min(...values)), high: common.map(({ values }) => Math.max(...values)),
  };
}

/**
 * Explains the end of a band.
 * @param {SeriesRow} row
 */
export const explainEnd = (row) => (row.constant_after_end ? "ended trials keep their last value" : "means stop where the first trial ends");

/**
 * Groups of trials as mean lines in bands.
 * @param {Group[]} groups @param {SeriesRow} row @param {string | null | undefined} unit of the trials @returns {Plot}
 */
export function bandPlot(groups, { name, constant_after_end }, unit) {
  const traces = groups.flatMap((group, i) => {
    const trials = averaged(group.replicates), { t_s, mean, low, high } = band(trials, constant_after_end), color = series(i);
    const edge = { type: "scatter", mode: "lines", x: t_s, line: { width: 0, color }, hoverinfo: "skip", showlegend: false, legendgroup: group.name };
    return [
      { ...edge, y: low },
      { ...edge, y: high, fill: "tonexty", fillcolor: transparent(color, 0.16) },
      { type: "scatter", mode: "lines", name: group.name, legendgroup: group.name, x: t_s, y: mean, line: { color, width: 1.6, dash: ["solid", "dash", "dot"][Math.floor(i / 8) % 3] },
        customdata: group.path && t_s.map(() => group.path), hovertemplate: `%{x:.3g} s: %{y:.4g}<extra>${group.name}, ${trials.length} trials</extra>` },
    ];
  });
  return {
    traces, layout: { xaxis: { title: { text: "belt time (s)" } }, yaxis: { title: { text: labelOf(name, unit) }, ...shareRange(name, traces.flatMap(({ y }) => y)) }, legend: { orientation: "v", x: 1.01, y: 1, font: { size: 10 } } },
    table: () => table(`${labelOf(name, unit)}: the last value of each trial`, [
      { title: "Design point", cell: (group) => group.name },
      { title: "Trials", is_number: true, cell: (group) => averaged(group.replicates).length },
      { title: "Mean", is_number: true, cell: (group) => number(meanOf(averaged(group.replicates).map(({ values }) => values[values.length - 1]))) },
    ], groups),
  };
}
