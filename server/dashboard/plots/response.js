// @ts-check
// A response over a factor: a dot for each trial, and the mean with its 95 % interval for each design point.

import { factorLabel, number, shortId } from "../format.js";
import { level, levels } from "../measures.js";
import { table } from "../parts.js";
import { colour, shareRange, series } from "./plot.js";

/** Colours that can be distinguished. */
const MAX_COLOURS = 8;

/**
 * Plots over the levels of `x`, with a colour for each level of the factor `by`, if given.
 * @param {PlotInput & { by?: string }} input @returns {Plot}
 */
export function responsePlot({ points, trials, factors, measure, x, by, path }) {
  const all = by ? levels(points, by) : [];
  /** @type {(Level | null)[]} */
  const groups = by && all.length <= MAX_COLOURS ? all : [null];
  /**
   * @template {PointRow | TrialRow} Row
   * @param {Row[]} rows @param {Level | null} group
   */
  const among = (rows, group) => (group === null || !by ? rows : rows.filter((row) => level(row.factors[by]) === group));
  const traces = groups.flatMap((group, i) => {
    const color = series(i), name = group === null || !by ? "mean and 95 % interval" : `${factorLabel(by, factors)}: ${number(group)}`;
    const rows = among(points, group).flatMap((row) => measured(row, measure));
    const dots = among(trials, group).map((trial) => ({ trial, value: measure.ofTrial(trial) })).filter(({ value }) => value !== null);
    const up = rows.map(({ value }) => (value.high === null ? 0 : value.high - value.mean));
    const down = rows.map(({ value }) => (value.low === null ? 0 : value.mean - value.low));
    return [
      { type: "scatter", mode: "markers", name: "trials", legendgroup: name, showlegend: false, marker: { color, size: 5, symbol: "circle-open" },
        x: dots.map(({ trial }) => level(trial.factors[x])), y: dots.map(({ value }) => value), customdata: dots.map(({ trial }) => `/jobs/${trial.job_id}`),
        text: dots.map(({ trial, value }) => pointText(trial.factors, factors, `${number(value)}<br>job ${shortId(trial.job_id)}, point ${trial.point}, seed ${trial.seed}: click to open the job`)), hoverinfo: "text" },
      { type: "scatter", mode: "markers", name, legendgroup: name, marker: { color, size: 8 },
        error_y: { type: "data", array: up, arrayminus: down, color, thickness: 1.2, width: 4 },
        x: rows.map(({ row }) => level(row.factors[x])), y: rows.map(({ value }) => value.mean), customdata: rows.map(({ row }) => path(row)),
        text: rows.map(({ row, value }) => pointText(row.factors, factors, `${number(value.mean)} of ${value.n} trials<br>point ${row.point}: click to open its jobs`)), hoverinfo: "text" },
    ];
  });
  return {
    traces: traces.filter((trace) => trace.x.length > 0),
    layout: { xaxis: { title: { text: factorLabel(x, factors) } }, yaxis: { title: { text: measure.label }, ...(measure.is_share ? { range: [-0.03, 1.03] } : shareRange(measure.name, traces.flatMap(({ y }) => y))) }, colorway: [colour("c0")] },
    table: () => responseTable({ points, factors, measure }),
  };
}

/**
 * A design point with its value; nothing where it has none.
 * @param {PointRow} row @param {Measure} measure
 */
export function measured(row, measure) {
  const value = measure.of(row);
  return value ? [{ row, value }] : [];
}

/**
 * The hover text of a point: `first`, then the level of each factor.
 * @param {Record<string, unknown>} values @param {string[]} factors @param {string} first
 */
export function pointText(values, factors, first) {
  return [first, ...factors.map((pointer) => `${factorLabel(pointer, factors)} ${number(level(values[pointer]))}`)].join("<br>");
}

/** @param {Pick<PlotInput, "points" | "factors" | "measure">} input */
function responseTable({ points, factors, measure }) {
  /** @type {Column<PointRow>[]} */
  const columns = [
    { title: "Point", is_number: true, cell: (row) => row.point },
    ...factors.map((pointer) => ({ title: factorLabel(pointer, factors), is_number: true, cell: (/** @type {PointRow} */ row) => number(level(row.factors[pointer])) })),
    { title: measure.label, is_number: true, cell: (row) => number(measure.of(row)?.mean) },
    { title: "95 % interval", is_number: true, cell: (row) => `${number(measure.of(row)?.low)} to ${number(measure.of(row)?.high)}` },
  ];
  return table(measure.label, columns, points.slice(0, 500));
}
