// A response against a factor: every trial as a dot, every design point as its mean with the 95 % interval.

import { factor, number, short } from "../format.js";
import { level, levels } from "../measures.js";
import { table } from "../parts.js";
import { colour, ofShares, series } from "./plot.js";

/** More colours than this cannot be told apart. */
const MOST_COLOURS = 8;

/**
 * Points over the levels of `x`, in one colour for each level of `by` (a pointer, or nothing).
 */
export function responsePlot({ points, trials, factors, measure, x, by, path }) {
  const all = by ? levels(points, by) : [];
  const groups = by && all.length <= MOST_COLOURS ? all : [null];
  const among = (rows, group) => (group === null ? rows : rows.filter((row) => level(row.factors[by]) === group));
  const traces = groups.flatMap((group, i) => {
    const ink = series(i), name = group === null ? "mean and 95 % interval" : `${factor(by, factors)}: ${number(group)}`;
    const rows = among(points, group).map((row) => ({ row, value: measure.of(row) })).filter(({ value }) => value);
    const dots = among(trials, group).map((trial) => ({ trial, value: measure.ofTrial(trial) })).filter(({ value }) => value !== null);
    const up = rows.map(({ value }) => (value.high === null ? 0 : value.high - value.mean));
    const down = rows.map(({ value }) => (value.low === null ? 0 : value.mean - value.low));
    return [
      { type: "scatter", mode: "markers", name: "trials", legendgroup: name, showlegend: false, marker: { color: ink, size: 5, symbol: "circle-open" },
        x: dots.map(({ trial }) => level(trial.factors[x])), y: dots.map(({ value }) => value), customdata: dots.map(({ trial }) => `/jobs/${trial.job_id}`),
        text: dots.map(({ trial, value }) => told(trial.factors, factors, `${number(value)}<br>job ${short(trial.job_id)}, point ${trial.point}, seed ${trial.seed}: click to open`)), hoverinfo: "text" },
      { type: "scatter", mode: "markers", name, legendgroup: name, marker: { color: ink, size: 8 },
        error_y: { type: "data", array: up, arrayminus: down, color: ink, thickness: 1.2, width: 4 },
        x: rows.map(({ row }) => level(row.factors[x])), y: rows.map(({ value }) => value.mean), customdata: rows.map(({ row }) => path(row)),
        text: rows.map(({ row, value }) => told(row.factors, factors, `${number(value.mean)} of ${value.n} trials<br>point ${row.point}: click for its jobs`)), hoverinfo: "text" },
    ];
  });
  return {
    traces: traces.filter((trace) => trace.x.length > 0),
    layout: { xaxis: { title: { text: factor(x, factors) } }, yaxis: { title: { text: measure.label }, ...(measure.is_share ? { range: [-0.03, 1.03] } : ofShares(measure.name, traces.flatMap(({ y }) => y))) }, colorway: [colour("c0")] },
    table: () => responseTable({ points, factors, measure }),
  };
}

/** What a point is, for who hovers over it. */
export function told(values, factors, first) {
  return [first, ...factors.map((pointer) => `${factor(pointer, factors)} ${number(level(values[pointer]))}`)].join("<br>");
}

function responseTable({ points, factors, measure }) {
  const columns = [
    { title: "Point", is_number: true, cell: (row) => row.point },
    ...factors.map((pointer) => ({ title: factor(pointer, factors), is_number: true, cell: (row) => number(level(row.factors[pointer])) })),
    { title: measure.label, is_number: true, cell: (row) => number(measure.of(row)?.mean) },
    { title: "95 % interval", is_number: true, cell: (row) => `${number(measure.of(row)?.low)} to ${number(measure.of(row)?.high)}` },
  ];
  return table(measure.label, columns, points.slice(0, 500));
}
