// Compression: stress over strain of every trial, with the straight lines whose slopes are the moduli.

import { factor, number } from "../../format.js";
import { level } from "../../measures.js";
import { table } from "../../parts.js";
import { series } from "../plot.js";

/** More curves than this are a smear. */
const MOST = 40;

/** `curves`: pairs of a trial and its curve of stress over strain. */
export function compressPlot({ points, factors, curves }) {
  const shown = curves.slice(0, MOST).map(({ trial, curve }) => ({ trial, curve, point: points.find((row) => row.point === trial.point) }));
  const name = ({ trial }) => factors.map((pointer) => `${factor(pointer, factors)} ${number(level(trial.factors[pointer]))}`).join(", ") || `seed ${trial.seed}`;
  const order = [...new Set(shown.map(({ trial }) => trial.point))].sort((a, b) => a - b);
  const style = ({ trial }) => ({ color: series(order.indexOf(trial.point)), width: 1.6 });
  const line = (one) => {
    const modulus = one.trial.responses.modulus_pa, end = Math.min(0.03, one.curve.x.at(-1));
    return typeof modulus === "number" ? { type: "scatter", mode: "lines", name: `modulus, ${name(one)}`, legendgroup: name(one), showlegend: false, x: [0, end], y: [0, modulus * end],
      line: { ...style(one), width: 1, dash: "dot" }, hovertemplate: `modulus ${number(modulus)} Pa<extra></extra>` } : null;
  };
  return {
    traces: shown.flatMap((one) => [
      { type: "scatter", mode: "lines", name: name(one), legendgroup: name(one), showlegend: one === shown.find(({ trial }) => trial.point === one.trial.point), x: one.curve.x, y: one.curve.values, line: style(one),
        customdata: one.curve.x.map(() => `/jobs/${one.trial.job_id}`), hovertemplate: `strain %{x:.4g}: %{y:.4g} Pa<extra>${name(one)}, seed ${one.trial.seed}</extra>` },
      line(one),
    ].filter(Boolean)),
    layout: { xaxis: { title: { text: "strain" } }, yaxis: { title: { text: "stress (Pa)" } } },
    table: () => table("Modulus and stress at the end of each trial", [
      { title: "Design", cell: name }, { title: "Seed", is_number: true, cell: ({ trial }) => trial.seed },
      { title: "Modulus (Pa)", is_number: true, cell: ({ trial }) => number(trial.responses.modulus_pa) }, { title: "Stress at end (Pa)", is_number: true, cell: ({ trial }) => number(trial.responses.stress_at_end_pa) },
    ], shown),
  };
}
