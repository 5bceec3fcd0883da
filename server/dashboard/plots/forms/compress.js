// @ts-check
// Compression: stress over strain of each trial, and straight lines whose slopes are the moduli.

import { factorLabel, number } from "../../format.js";
import { level } from "../../measures.js";
import { table } from "../../parts.js";
import { series } from "../plot.js";

/** Curves that can be distinguished. */
const MAX_CURVES = 40;

/** @param {PlotInput} input @returns {Plot} */
export function compressPlot({ factors, curves }) {
  const shown = curves.flatMap(({ trial, curve }) => (curve ? [{ trial, curve }] : [])).slice(0, MAX_CURVES);
  const name = (/** @type {{ trial: TrialRow }} */ { trial }) => factors.map((pointer) => `${factorLabel(pointer, factors)} ${number(level(trial.factors[pointer]))}`).join(", ") || `seed ${trial.seed}`;
  const order = [...new Set(shown.map(({ trial }) => trial.point))].sort((a, b) => a - b);
  const style = (/** @type {{ trial: TrialRow }} */ { trial }) => ({ color: series(order.indexOf(trial.point)), width: 1.6 });
  const modulusLine = (/** @type {(typeof shown)[number]} */ one) => {
    const modulus = one.trial.responses.modulus_pa, end = Math.min(0.03, one.curve.x.at(-1) ?? 0);
    return typeof modulus === "number" ? [{ type: "scatter", mode: "lines", name: `modulus, ${name(one)}`, legendgroup: name(one), showlegend: false, x: [0, end], y: [0, modulus * end],
      line: { ...style(one), width: 1, dash: "dot" }, hovertemplate: `modulus ${number(modulus)} Pa<extra></extra>` }] : [];
  };
  return {
    traces: shown.flatMap((one) => [
      { type: "scatter", mode: "lines", name: name(one), legendgroup: name(one), showlegend: one === shown.find(({ trial }) => trial.point === one.trial.point), x: one.curve.x, y: one.curve.values, line: style(one),
        customdata: one.curve.x.map(() => `/jobs/${one.trial.job_id}`), hovertemplate: `strain %{x:.4g}: %{y:.4g} Pa<extra>${name(one)}, seed ${one.trial.seed}</extra>` },
      ...modulusLine(one),
    ]),
    layout: { xaxis: { title: { text: "strain" } }, yaxis: { title: { text: "stress (Pa)" } } },
    table: () => table("Modulus and final stress of each trial", [
      { title: "Design", cell: name }, { title: "Seed", is_number: true, cell: ({ trial }) => trial.seed },
      { title: "Modulus (Pa)", is_number: true, cell: ({ trial }) => number(trial.responses.modulus_pa) }, { title: "Final stress (Pa)", is_number: true, cell: ({ trial }) => number(trial.responses.stress_at_end_pa) },
    ], shown),
  };
}
