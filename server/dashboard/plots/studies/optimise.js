// @ts-check
// Recommended and rejected points: the objective of each, or both objectives as a front, with 95 % intervals.

import { number } from "../../format.js";
import { table } from "../../parts.js";
import { colour, panel } from "../plot.js";
import { alongPoints, errorBars, factorColumns, intervalText, placeText, wholeRange } from "./labels.js";

/** @typedef {import("./labels.js").WithInterval} WithInterval */
/** @typedef {Recommendation & { is_recommended: boolean }} Row */

const STATES = { open: "under confirmation", confirmed: "confirmed", refuted: "refuted", undecided: "undecided" };

/** @param {Row} row */
const stateText = ({ confirmation }) => (confirmation ? STATES[confirmation.state] : "not confirmed yet");

/**
 * The objectives of a point: of its confirmation where it has begun, else as forecast.
 * @param {Row} row @returns {WithInterval[]}
 */
const objectivesOf = ({ objectives, confirmation }) => objectives.map((forecast, i) => confirmation?.objectives[i] ?? forecast);

/** @param {import("./pictures.js").PictureInput} input */
export function optimisePictures({ goal, factors, label }) {
  const title = (/** @type {Record<string, StudyMeasure>} */ objective) => Object.entries(objective).map(([word, of]) => ({ name: label(of), word }))[0];
  const names = goal.objectives.map(title), limits = goal.constraints ?? [];
  const plot = panel(names.length > 1 ? "Front" : "Recommended point", { is_wide: true, size: "tall-plot", empty_text: "No point is recommended yet." });
  return [{
    card: plot.card,
    draw: (/** @type {OptimiseFinding} */ { recommended, rejected }) => plot.draw(() => {
      const rows = [...recommended.map((row) => ({ ...row, is_recommended: true })), ...rejected.map((row) => ({ ...row, is_recommended: false }))];
      return optimisePlot({ rows, names, constraints: limits.map(constraintText), factors });
    }),
  }];

  /** @param {{ of: StudyMeasure, at_most?: number, at_least?: number }} limit */
  function constraintText({ of, at_most, at_least }) {
    return at_most === undefined || at_most === null ? `${label(of)} ≥ ${number(at_least)}` : `${label(of)} ≤ ${number(at_most)}`;
  }
}

/** @param {{ rows: Row[], names: { name: string, word: string }[], constraints: string[], factors: StudyFactor[] }} input @returns {Plot} */
function optimisePlot({ rows, names, constraints, factors }) {
  const is_front = names.length > 1;
  const groups = [
    { name: "recommended, confirmed by fresh seeds", color: colour("c2"), symbol: "circle", is_in: (/** @type {Row} */ row) => row.is_recommended && row.confirmation?.state === "confirmed" },
    { name: "recommended, not confirmed yet", color: colour("c0"), symbol: "circle", is_in: (/** @type {Row} */ row) => row.is_recommended && row.confirmation?.state !== "confirmed" },
    { name: "rejected by fresh seeds", color: colour("c1"), symbol: "x", is_in: (/** @type {Row} */ row) => !row.is_recommended },
  ];
  const traces = groups.map(({ name, color, symbol, is_in }) => {
    const group = rows.filter(is_in), values = group.map(objectivesOf), along = (/** @type {number} */ i) => values.map((all) => all[i]);
    const text = group.map((row, k) => [placeText(factors, row.values), ...names.map((one, i) => `${one.name} ${number(values[k][i].value)} (${intervalText(values[k][i])})`), stateText(row)].join("<br>"));
    const up = along(is_front ? 1 : 0);
    return { type: "scatter", mode: "markers", name, x: is_front ? along(0).map(({ value }) => value) : alongPoints(factors, group).x, y: up.map(({ value }) => value), marker: { color, size: 11, symbol },
      error_y: errorBars(up, color), ...(is_front && { error_x: errorBars(along(0), color) }), text, hoverinfo: "text" };
  });
  const axis = (/** @type {number} */ i) => ({ title: { text: `${names[i].name}, ${names[i].word}d` } });
  return {
    traces: traces.filter((trace) => trace.x.length > 0),
    layout: { xaxis: is_front ? axis(0) : { ...alongPoints(factors, rows).xaxis, ...(factors.length === 1 && wholeRange(factors[0], 0.03)) }, yaxis: axis(is_front ? 1 : 0) },
    table: () => table("Points with their objectives and constraints; 95 % intervals and bounds", [
      ...factorColumns(factors),
      { title: "State", cell: (row) => `${row.is_recommended ? "recommended" : "rejected"}, ${stateText(row)}` },
      ...names.flatMap(({ name }, i) => /** @type {Column<Row>[]} */ ([
        { title: name, is_number: true, cell: (row) => number(objectivesOf(row)[i].value) }, { title: "95 % interval", is_number: true, cell: (row) => intervalText(objectivesOf(row)[i]) },
      ])),
      ...constraints.map((title, i) => /** @type {Column<Row>} */ ({ title, is_number: true, cell: ({ constraints, confirmation }) => intervalText(confirmation?.constraints[i] ?? constraints[i]) })),
    ], rows),
    note: "Values of points without a confirmation are forecasts of the model.",
  };
}
