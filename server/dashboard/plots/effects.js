// Main effects on one response: how much each factor changes it over its whole range.

import { factor, number } from "../format.js";
import { table } from "../parts.js";
import { colour } from "./plot.js";

/** From what `GET /v1/sweeps/{id}/effects` says of one response. */
export function effectsPlot({ effects, factors, label }) {
  // Of words there is no line; how far the means of their levels lie apart is the same for two levels.
  const rows = (effects?.factors ?? []).map((one) => {
    const means = one.levels.map((level) => level.mean);
    const apart = means.length > 1 ? Math.max(...means) - Math.min(...means) : null;
    return { ...one, title: factor(one.factor, factors), size: one.effect ?? apart, is_range: one.effect === null };
  }).filter((one) => one.size !== null).sort((a, b) => Math.abs(a.size) - Math.abs(b.size));
  const likely = (one) => (one.p_value === null || one.p_value === undefined ? "" : `<br>rank correlation ${number(one.rank_correlation, 3)}, by chance ${number(one.p_value, 2)}`);
  return {
    traces: rows.length === 0 ? [] : [{
      type: "bar", orientation: "h", y: rows.map((one) => one.title), x: rows.map((one) => one.size),
      marker: { color: rows.map((one) => (one.is_range ? colour("c7") : one.size < 0 ? colour("c1") : colour("c0"))) },
      text: rows.map((one) => number(one.size, 3)), textposition: "auto", insidetextfont: { color: colour("raised") }, hoverinfo: "text",
      hovertext: rows.map((one) => `${one.title}: ${one.is_range ? "largest less smallest mean" : "change over its range"} ${number(one.size)}${likely(one)}`),
    }],
    layout: { showlegend: false, xaxis: { title: { text: `change of ${label}` } }, yaxis: { automargin: true } },
    table: () => table(`Effects on ${label}`, [
      { title: "Factor", cell: (one) => one.title },
      { title: "Effect", is_number: true, cell: (one) => number(one.size) },
      { title: "Rank correlation", is_number: true, cell: (one) => number(one.rank_correlation) },
      { title: "By chance", is_number: true, cell: (one) => number(one.p_value, 2) },
    ], [...rows].reverse()),
  };
}
