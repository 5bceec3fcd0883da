// @ts-check
// Main effects on one response: its change over the range of each factor, with 95 % intervals.

import { factorLabel, number } from "../format.js";
import { table } from "../parts.js";
import { colour } from "./plot.js";

/**
 * Plots one response of `GET /v1/sweeps/{id}/effects`.
 * @param {{ effects: ResponseEffects | undefined, pairing: PairingGain | undefined, factors: string[], label: string }} input @returns {Plot}
 */
export function effectsPlot({ effects, pairing, factors, label }) {
  // A factor of words has no slope: the range of its means by level is drawn instead.
  const rows = (effects?.factors ?? []).map((one) => {
    const means = one.levels.map((level) => level.mean);
    const range = means.length > 1 ? Math.max(...means) - Math.min(...means) : null;
    return { ...one, title: factorLabel(one.factor, factors), size: one.effect ?? range ?? NaN, is_range: one.effect === null };
  }).filter((one) => !Number.isNaN(one.size)).sort((a, b) => Math.abs(a.size) - Math.abs(b.size));
  const correlation = (/** @type {(typeof rows)[number]} */ one) => (one.p_value === null || one.p_value === undefined ? "" : `<br>rank correlation ${number(one.rank_correlation, 3)}, p-value ${number(one.p_value, 2)}`);
  const interval = (/** @type {(typeof rows)[number]} */ one) => (typeof one.low_95 === "number" ? `${number(one.low_95)} to ${number(one.high_95)}` : "–");
  const ends = (/** @type {(typeof rows)[number]} */ one) => [one.low_95 ?? one.size, one.high_95 ?? one.size];
  return {
    traces: rows.length === 0 ? [] : [{
      type: "bar", orientation: "h", y: rows.map((one) => one.title), x: rows.map((one) => one.size),
      marker: { color: rows.map((one) => (one.is_range ? colour("c7") : one.size < 0 ? colour("c1") : colour("c0"))) },
      error_x: { type: "data", array: rows.map((one) => ends(one)[1] - one.size), arrayminus: rows.map((one) => one.size - ends(one)[0]), color: colour("text"), thickness: 1.2, width: 4 },
      text: rows.map((one) => number(one.size, 3)), textposition: "auto", insidetextfont: { color: colour("raised") }, hoverinfo: "text",
      hovertext: rows.map((one) => `${one.title}: ${one.is_range ? "maximum minus minimum of the means" : "change over the range of the factor"} ${number(one.size)}<br>95 % interval ${interval(one)}${correlation(one)}`),
    }],
    layout: { showlegend: false, xaxis: { title: { text: `change of ${label}` } }, yaxis: { automargin: true } },
    table: () => table(`Effects on ${label}`, [
      { title: "Factor", cell: (one) => one.title },
      { title: "Effect", is_number: true, cell: (one) => number(one.size) },
      { title: "95 % interval", is_number: true, cell: interval },
      { title: "Rank correlation", is_number: true, cell: (one) => number(one.rank_correlation) },
      { title: "p-value", is_number: true, cell: (one) => number(one.p_value, 2) },
    ], [...rows].reverse()),
    note: pairing?.sentence,
  };
}
