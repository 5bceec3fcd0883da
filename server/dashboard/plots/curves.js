// Curves over time: of one job, or of a sweep by design point, with the band that its replicates span.

import { number, titled } from "../format.js";
import { table } from "../parts.js";
import { series, sheer } from "./plot.js";

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
    layout: { showlegend: lines.length > 1, xaxis: { title: { text: across } }, yaxis: { title: { text: titled(first.name, first.unit) } } },
    table: () => table(titled(first.name, first.unit), [
      { title: across, is_number: true, cell: (i) => number((first.t_s ?? first.x)[i]) },
      ...lines.map(({ name, data }) => ({ title: name, is_number: true, cell: (i) => number(data.values[i]) })),
    ], first.values.map((_, i) => i).slice(0, 400)),
  };
}

/** The value of a sampled curve at a time; before its first sample and after its last, nothing. */
function at({ t_s, values }, t) {
  if (t_s.length === 0 || t < t_s[0] || t > t_s.at(-1)) return null;
  let low = 0, high = t_s.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t_s[middle] <= t) low = middle;
    else high = middle;
  }
  const share = high === low ? 0 : (t - t_s[low]) / (t_s[high] - t_s[low]);
  return values[low] + share * (values[high] - values[low]);
}

/** The mean of replicates on the longest one's times, with least and greatest. A run that ended early keeps out of the band after its end. */
function band(replicates) {
  const times = replicates.reduce((longest, one) => (one.t_s.length > longest.length ? one.t_s : longest), []);
  const values = times.map((t) => replicates.map((one) => at(one, t)).filter((value) => value !== null));
  return {
    t_s: times, mean: values.map((all) => (all.length ? all.reduce((a, b) => a + b, 0) / all.length : null)),
    low: values.map((all) => (all.length ? Math.min(...all) : null)), high: values.map((all) => (all.length ? Math.max(...all) : null)),
  };
}

/** Groups (`name`, `path` that a click leads to, `replicates`: series) as mean lines in bands. */
export function bandPlot(groups, name, unit) {
  const traces = groups.flatMap((group, i) => {
    const { t_s, mean, low, high } = band(group.replicates), ink = series(i);
    const edge = { type: "scatter", mode: "lines", x: t_s, line: { width: 0, color: ink }, hoverinfo: "skip", showlegend: false, legendgroup: group.name };
    return [
      { ...edge, y: low },
      { ...edge, y: high, fill: "tonexty", fillcolor: sheer(ink, 0.16) },
      { type: "scatter", mode: "lines", name: group.name, legendgroup: group.name, x: t_s, y: mean, line: { color: ink, width: 1.6, dash: ["solid", "dash", "dot"][Math.floor(i / 8) % 3] },
        customdata: group.path && t_s.map(() => group.path), hovertemplate: `%{x:.3g} s: %{y:.4g}<extra>${group.name}, ${group.replicates.length} trials</extra>` },
    ];
  });
  return {
    traces, layout: { xaxis: { title: { text: "belt time (s)" } }, yaxis: { title: { text: titled(name, unit) } }, legend: { orientation: "v", x: 1.01, y: 1, font: { size: 10 } } },
    table: () => table(`${titled(name, unit)} at the end`, [
      { title: "Design point", cell: (group) => group.name },
      { title: "Trials", is_number: true, cell: (group) => group.replicates.length },
      { title: "Mean", is_number: true, cell: (group) => number(band(group.replicates).mean.at(-1)) },
    ], groups),
  };
}
