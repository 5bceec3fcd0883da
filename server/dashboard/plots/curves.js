// Curves over time: of one job, or of a sweep by design point, with the band that its replicates span.

import { number, titled } from "../format.js";
import { table } from "../parts.js";
import { ofShares, series, sheer } from "./plot.js";

/** Series and curves of a result. */
export const curvesOf = (result) => [...result.series, ...(result.curves ?? [])];

/** What a curve is known by: a name may stand over time and over something else. */
export const curveKey = (data) => `${data.name} over ${data.over ?? "time"}`;

/** What is counted is drawn as dots: nothing lies between two fillets. */
const COUNTED = ["fillet", "body"];

/** A series or curve of a result, as lines; `name` is for the legend. */
export function linePlot(lines) {
  const first = lines[0]?.data;
  if (!first) return { traces: [], layout: {}, table: () => "" };
  const across = first.t_s ? "belt time (s)" : titled(first.over, first.over_unit);
  return {
    traces: lines.map(({ name, data, path }, i) => ({
      type: "scatter", mode: COUNTED.includes(data.over) ? "markers" : "lines", name, x: data.t_s ?? data.x, y: data.values, line: { color: series(i), width: 1.6 },
      customdata: path && data.values.map(() => path), hovertemplate: `%{x:.4g}, %{y:.4g}<extra>${name}</extra>`,
    })),
    layout: { showlegend: lines.length > 1, xaxis: { title: { text: across } }, yaxis: { title: { text: titled(first.name, first.unit) }, ...ofShares(first.name, lines.flatMap(({ data }) => data.values)) } },
    table: () => table(titled(first.name, first.unit), [
      { title: across, is_number: true, cell: (i) => number((first.t_s ?? first.x)[i]) },
      ...lines.map(({ name, data }) => ({ title: name, is_number: true, cell: (i) => number(data.values[i]) })),
    ], first.values.map((_, i) => i).slice(0, 400)),
  };
}

/** What stays as it is when a run has ended: nothing comes out any more, and nothing breaks. */
const KEPT = ["discharged_mass", "bonds_intact_fraction"];

/** The value of a sampled curve at a time; before its first sample nothing, and after its last one nothing or, where it is kept, that. */
function at({ t_s, values }, t, is_kept) {
  if (t_s.length === 0 || t < t_s[0]) return null;
  if (t > t_s.at(-1)) return is_kept ? values.at(-1) : null;
  let low = 0, high = t_s.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t_s[middle] <= t) low = middle;
    else high = middle;
  }
  const share = high === low ? 0 : (t - t_s[low]) / (t_s[high] - t_s[low]);
  return values[low] + share * (values[high] - values[low]);
}

/** Replicates that a mean is taken of: those that have ended; before any has, those that run. */
function counted(replicates) {
  const ended = replicates.filter((one) => !one.partial);
  return ended.length ? ended : replicates;
}

const meanOf = (values) => values.reduce((a, b) => a + b, 0) / values.length;

/** The mean of replicates on the longest one's times, with least and greatest, as long as every one has a value: a mean of fewer would leap where one ends. */
function band(replicates, is_kept) {
  const longest = replicates.reduce((longest, { t_s }) => ((t_s.at(-1) ?? -Infinity) > (longest.at(-1) ?? -Infinity) ? t_s : longest), []);
  const there = longest.map((t) => ({ t, values: replicates.map((one) => at(one, t, is_kept && !one.partial)) })).filter(({ values }) => !values.includes(null));
  return {
    t_s: there.map(({ t }) => t), mean: there.map(({ values }) => meanOf(values)),
    low: there.map(({ values }) => Math.min(...values)), high: there.map(({ values }) => Math.max(...values)),
  };
}

/** How the end of a band is meant, in words. */
export const endOf = (name) => (KEPT.includes(name) ? "what has ended keeps its last value" : "means end with the first trial that ends");

/** Groups (`name`, `path` that a click leads to, `replicates`: series) as mean lines in bands. */
export function bandPlot(groups, name, unit) {
  const traces = groups.flatMap((group, i) => {
    const trials = counted(group.replicates), { t_s, mean, low, high } = band(trials, KEPT.includes(name)), ink = series(i);
    const edge = { type: "scatter", mode: "lines", x: t_s, line: { width: 0, color: ink }, hoverinfo: "skip", showlegend: false, legendgroup: group.name };
    return [
      { ...edge, y: low },
      { ...edge, y: high, fill: "tonexty", fillcolor: sheer(ink, 0.16) },
      { type: "scatter", mode: "lines", name: group.name, legendgroup: group.name, x: t_s, y: mean, line: { color: ink, width: 1.6, dash: ["solid", "dash", "dot"][Math.floor(i / 8) % 3] },
        customdata: group.path && t_s.map(() => group.path), hovertemplate: `%{x:.3g} s: %{y:.4g}<extra>${group.name}, ${trials.length} trials</extra>` },
    ];
  });
  return {
    traces, layout: { xaxis: { title: { text: "belt time (s)" } }, yaxis: { title: { text: titled(name, unit) }, ...ofShares(name, traces.flatMap(({ y }) => y)) }, legend: { orientation: "v", x: 1.01, y: 1, font: { size: 10 } } },
    table: () => table(`${titled(name, unit)}: the last value of each trial`, [
      { title: "Design point", cell: (group) => group.name },
      { title: "Trials", is_number: true, cell: (group) => counted(group.replicates).length },
      { title: "Mean", is_number: true, cell: (group) => number(meanOf(counted(group.replicates).map(({ values }) => values.at(-1)))) },
    ], groups),
  };
}
