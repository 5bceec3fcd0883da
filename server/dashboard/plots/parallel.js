// @ts-check
// Parallel coordinates: an axis for each factor and for the response, a line for each design point, and limits that select lines.
// It is SVG of our own, because plotly.js would compile code from text here, which the content security policy refuses.

import { fill, h, svg } from "../dom.js";
import { factorLabel, number } from "../format.js";
import { level, levels } from "../measures.js";
import { colour } from "./plot.js";

const [HEIGHT, TOP, BOTTOM, SIDE] = [340, 44, 24, 90];
/** Lines that are drawn: more are slow and cannot be distinguished. */
const MAX_LINES = 3000;

/**
 * @typedef {object} Axis
 * @property {string} key
 * @property {string} title
 * @property {(row: PointRow) => number} at place of a design point, from 0 at the bottom to 1 at the top
 * @property {[number, string][]} ticks
 * @property {{ low: number, span: number } | null} limits of an axis of numbers
 */

/**
 * An axis; words lie at equal distances.
 * @param {string} key @param {string} title @param {Level[]} values @param {(row: PointRow) => Level} of @returns {Axis}
 */
function axis(key, title, values, of) {
  const numbers = values.filter((value) => typeof value === "number");
  if (numbers.length < values.length) {
    const place = (/** @type {Level} */ value) => (values.length > 1 ? values.indexOf(value) / (values.length - 1) : 0.5);
    return { key, title, at: (row) => place(of(row)), ticks: values.map((value) => [place(value), String(value)]), limits: null };
  }
  const low = Math.min(...numbers), high = Math.max(...numbers), span = high - low;
  if (span === 0) return { key, title, at: () => 0.5, ticks: [[0.5, number(low)]], limits: null };
  /** @type {[number, string][]} */
  const ticks = [0, 0.25, 0.5, 0.75, 1].map((share) => [share, number(low + share * span, 3)]);
  return { key, title, at: (row) => (Number(of(row)) - low) / span, ticks, limits: { low, span } };
}

/** @typedef {{ axes: Axis[], measure: string, left_out: number, without: number, marks: SVGElement[], lines: { element: SVGElement, places: number[] }[] }} Drawing */
/** @typedef {SweepData & { measure: Measure }} Input */

export function parallel() {
  const figure = svg("svg", { class: "coordinates", role: "img", "aria-label": "Parallel coordinates of the design points" });
  const summary = h("p", { class: "dim", role: "status" });
  const limits = h("div", { class: "form" });
  const card = h("section", { class: "card", hidden: true }, h("h2", {}, "Parallel coordinates"), summary, figure,
    h("details", { class: "under" }, h("summary", {}, "Limits in numbers"), limits));
  /** @type {Map<string, number[]>} */
  const brushes = new Map();
  /** @type {Drawing} */
  let shown = { axes: [], measure: "", left_out: 0, without: 0, marks: [], lines: [] };

  const passes = (/** @type {number[]} */ places) => shown.axes.every((axis, i) => {
    const brush = brushes.get(axis.key);
    return !brush || (places[i] >= brush[0] - 1e-9 && places[i] <= brush[1] + 1e-9);
  });
  const y = (/** @type {number} */ share) => HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM);
  const x = (/** @type {number} */ i) => SIDE + (i * (figure.clientWidth - 2 * SIDE)) / Math.max(1, shown.axes.length - 1);

  function paint() {
    let count = 0;
    for (const { element, places } of shown.lines) {
      const is_in = passes(places);
      count += Number(is_in);
      element.classList.toggle("out", !is_in);
    }
    summary.textContent = `${count} of ${shown.lines.length} design points${brushes.size ? " pass" : ""}${shown.left_out ? `; ${shown.left_out} more not drawn` : ""}${shown.without ? `; ${shown.without} without a value` : ""}`;
    for (const [i, axis] of shown.axes.entries()) {
      const brush = brushes.get(axis.key), mark = shown.marks[i];
      mark.setAttribute("visibility", brush ? "visible" : "hidden");
      if (brush) {
        mark.setAttribute("y", String(y(brush[1])));
        mark.setAttribute("height", String(Math.max(2, y(brush[0]) - y(brush[1]))));
      }
    }
  }

  /** @param {Axis} axis @param {PointerEvent} event */
  function drag(axis, event) {
    const share = (/** @type {PointerEvent} */ event) => {
      const inside = event.clientY - figure.getBoundingClientRect().top;
      return Math.min(1, Math.max(0, (HEIGHT - BOTTOM - inside) / (HEIGHT - TOP - BOTTOM)));
    };
    const from = share(event), target = /** @type {SVGElement} */ (event.currentTarget);
    target.setPointerCapture(event.pointerId);
    const move = (/** @type {PointerEvent} */ event) => {
      brushes.set(axis.key, [from, share(event)].sort((a, b) => a - b));
      paint();
    };
    const end = (/** @type {PointerEvent} */ event) => {
      target.removeEventListener("pointermove", move);
      // A click removes the limits.
      if (Math.abs(share(event) - from) < 0.01) brushes.delete(axis.key);
      paint();
    };
    target.addEventListener("pointermove", move);
    target.addEventListener("pointerup", end, { once: true });
  }

  /** @param {string} key @param {string} title @param {{ low: number, span: number }} limits */
  function limitInputs(key, title, { low, span }) {
    const [from, to] = [low, low + span].map((value) => h("input", { type: "number", step: "any", placeholder: number(value), onchange: () => void change() }));
    const change = () => {
      const share = (/** @type {HTMLInputElement} */ input, /** @type {number} */ otherwise) => (input.value === "" ? otherwise : (Number(input.value) - low) / span);
      if (from.value === "" && to.value === "") brushes.delete(key);
      else brushes.set(key, [share(from, 0), share(to, 1)]);
      paint();
    };
    return [h("label", {}, `${title}: from`, from), h("label", {}, `${title}: to`, to)];
  }

  /** @param {Input} input */
  function draw({ points, factors, measure, path: pathOf }) {
    const measured = points.filter((row) => measure.of(row)), rows = measured.slice(0, MAX_LINES);
    card.hidden = rows.length === 0 || factors.length === 0;
    if (card.hidden) return;
    const value = (/** @type {PointRow} */ row) => measure.of(row)?.mean ?? NaN;
    const axes = [...factors.map((pointer) => axis(pointer, factorLabel(pointer, factors), levels(rows, pointer), (row) => level(row.factors[pointer]))),
      axis("measure", measure.label, rows.map(value), value)];
    if (brushes.has("measure") && shown.measure !== measure.name) brushes.delete("measure");
    shown = { axes, measure: measure.name, left_out: measured.length - rows.length, without: points.length - measured.length, marks: [], lines: [] };
    const colours = [colour("c0"), colour("c4"), colour("c1")];
    shown.lines = rows.map((row) => {
      const places = axes.map((axis) => axis.at(row)), last = places[places.length - 1];
      const path = places.map((share, i) => `${i ? "L" : "M"}${x(i).toFixed(1)},${y(share).toFixed(1)}`).join("");
      const stroke = `color-mix(in oklab, ${last < 0.5 ? colours[0] : colours[2]} ${Math.round(200 * Math.abs(last - 0.5))}%, ${colours[1]})`;
      const element = svg("path", { d: path, style: { stroke, "stroke-width": rows.length > 300 ? "0.7" : "1.4" }, onclick: () => (location.href = pathOf(row) ?? location.href) },
        svg("title", {}, `point ${row.point}: ${measure.label} ${number(value(row))}; click to open its jobs`));
      return { element, places };
    });
    const parts = axes.map((axis, i) => {
      const mark = svg("rect", { x: x(i) - 7, width: 14, class: "brush", visibility: "hidden" });
      const hit = svg("rect", { x: x(i) - 16, y: TOP - 6, width: 32, height: HEIGHT - TOP - BOTTOM + 12, class: "hit", onpointerdown: (/** @type {PointerEvent} */ event) => drag(axis, event) });
      shown.marks.push(mark);
      return svg("g", {}, svg("line", { x1: x(i), x2: x(i), y1: y(0), y2: y(1), class: "axis" }),
        svg("text", { x: x(i), y: i % 2 ? 14 : 28, "text-anchor": "middle" }, axis.title),
        axis.ticks.map(([share, text]) => svg("text", { x: x(i) + 6, y: y(share) + 4 }, text)), mark, hit);
    });
    figure.replaceChildren(svg("g", {}, shown.lines.map(({ element }) => element)), ...parts);
    if (!limits.contains(document.activeElement)) fill(limits, axes.map((axis) => axis.limits && limitInputs(axis.key, axis.title, axis.limits)));
    paint();
  }
  /** @type {Input | null} */
  let newest = null;
  for (const name of ["theme", "resize"]) addEventListener(name, () => newest && draw(newest));
  return { card, draw: (/** @type {Input} */ input) => draw((newest = input)) };
}
