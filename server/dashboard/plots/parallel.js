// Parallel coordinates, as SVG of our own: plotly's need code from text. An axis for every factor and the chosen response, a line for every
// design point; drag along axes to keep what passes, or write limits.

import { fill, h, svg } from "../dom.js";
import { factor, number } from "../format.js";
import { level, levels } from "../measures.js";
import { colour } from "./plot.js";

const [HEIGHT, TOP, BOTTOM, SIDE] = [340, 44, 24, 90];
/** More lines than this are a smear, and slow. */
const MOST_LINES = 3000;

/** An axis: where a point is on it, 0 at the bottom to 1 at the top; words stand at equal distances. */
function axis(key, title, values, of) {
  const words = values.some((value) => typeof value !== "number");
  if (words) {
    const place = (value) => (values.length > 1 ? values.indexOf(value) / (values.length - 1) : 0.5);
    return { key, title, at: (row) => place(of(row)), ticks: values.map((value) => [place(value), String(value)]), limits: null };
  }
  const low = Math.min(...values), high = Math.max(...values), span = high - low;
  if (span === 0) return { key, title, at: () => 0.5, ticks: [[0.5, number(low)]], limits: null };
  const place = (value) => (value === null ? null : (value - low) / span);
  const ticks = [0, 0.25, 0.5, 0.75, 1].map((share) => [share, number(low + share * span, 3)]);
  return { key, title, at: (row) => place(of(row)), ticks, limits: { low, span } };
}

export function parallel() {
  const figure = svg("svg", { class: "coordinates", role: "img", "aria-label": "Parallel coordinates of the design points" });
  const kept = h("p", { class: "dim", role: "status" });
  const limits = h("div", { class: "form" });
  const card = h("section", { class: "card", hidden: true }, h("h2", {}, "Parallel coordinates"), kept, figure,
    h("details", { class: "under" }, h("summary", {}, "Limits in numbers"), limits));
  const brushes = new Map();
  let shown = null;

  const passes = (places) => shown.axes.every((axis, i) => {
    const brush = brushes.get(axis.key);
    return !brush || (places[i] >= brush[0] - 1e-9 && places[i] <= brush[1] + 1e-9);
  });
  const y = (share) => HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM);
  const x = (i) => SIDE + (i * (figure.clientWidth - 2 * SIDE)) / Math.max(1, shown.axes.length - 1);

  function paint() {
    let count = 0;
    for (const { element, places } of shown.lines) {
      const is_in = passes(places);
      count += is_in;
      element.classList.toggle("out", !is_in);
    }
    kept.textContent = `${count} of ${shown.lines.length} design points${brushes.size ? " pass" : ""}${shown.left_out ? `; ${shown.left_out} more are not drawn` : ""}${shown.without ? `; ${shown.without} have no value` : ""}`;
    for (const [i, axis] of shown.axes.entries()) {
      const brush = brushes.get(axis.key), mark = shown.marks[i];
      mark.setAttribute("visibility", brush ? "visible" : "hidden");
      if (brush) {
        mark.setAttribute("y", y(brush[1]));
        mark.setAttribute("height", Math.max(2, y(brush[0]) - y(brush[1])));
      }
    }
  }

  function drag(axis, event) {
    const share = (event) => {
      const inside = event.clientY - figure.getBoundingClientRect().top;
      return Math.min(1, Math.max(0, (HEIGHT - BOTTOM - inside) / (HEIGHT - TOP - BOTTOM)));
    };
    const from = share(event), target = event.currentTarget;
    target.setPointerCapture(event.pointerId);
    const move = (event) => (brushes.set(axis.key, [from, share(event)].sort((a, b) => a - b)), paint());
    const end = (event) => {
      target.removeEventListener("pointermove", move);
      // A click takes the limits away.
      if (Math.abs(share(event) - from) < 0.01) brushes.delete(axis.key);
      paint();
    };
    target.addEventListener("pointermove", move);
    target.addEventListener("pointerup", end, { once: true });
  }

  function limit({ key, title, limits: { low, span } }) {
    const [from, to] = [low, low + span].map((value) => h("input", { type: "number", step: "any", placeholder: number(value), onchange: () => change() }));
    const change = () => {
      const share = (input, otherwise) => (input.value === "" ? otherwise : (Number(input.value) - low) / span);
      if (from.value === "" && to.value === "") brushes.delete(key);
      else brushes.set(key, [share(from, 0), share(to, 1)]);
      paint();
    };
    return [h("label", {}, `${title}: from`, from), h("label", {}, `${title}: to`, to)];
  }

  function draw({ points, factors, measure, path: pathOf }) {
    const measured = points.filter((row) => measure.of(row)), rows = measured.slice(0, MOST_LINES);
    card.hidden = rows.length === 0 || factors.length === 0;
    if (card.hidden) return;
    const value = (row) => measure.of(row)?.mean ?? null;
    const axes = [...factors.map((pointer) => axis(pointer, factor(pointer, factors), levels(rows, pointer), (row) => level(row.factors[pointer]))),
      axis("measure", measure.label, rows.map(value), value)];
    if (brushes.has("measure") && shown?.measure !== measure.name) brushes.delete("measure");
    shown = { axes, measure: measure.name, left_out: measured.length - rows.length, without: points.length - measured.length, marks: [], lines: [] };
    const inks = [colour("c0"), colour("c4"), colour("c1")];
    shown.lines = rows.map((row) => {
      const places = axes.map((axis) => axis.at(row)), last = places.at(-1);
      const path = places.map((share, i) => `${i ? "L" : "M"}${x(i).toFixed(1)},${y(share).toFixed(1)}`).join("");
      const stroke = `color-mix(in oklab, ${last < 0.5 ? inks[0] : inks[2]} ${Math.round(200 * Math.abs(last - 0.5))}%, ${inks[1]})`;
      const element = svg("path", { d: path, style: { stroke, "stroke-width": rows.length > 300 ? "0.7" : "1.4" }, onclick: () => (location.href = pathOf(row)) },
        svg("title", {}, `point ${row.point}: ${measure.label} ${number(value(row))}; click for its jobs`));
      return { element, places };
    });
    const parts = axes.map((axis, i) => {
      const mark = svg("rect", { x: x(i) - 7, width: 14, class: "brush", visibility: "hidden" });
      const hit = svg("rect", { x: x(i) - 16, y: TOP - 6, width: 32, height: HEIGHT - TOP - BOTTOM + 12, class: "hit", onpointerdown: (event) => drag(axis, event) });
      shown.marks.push(mark);
      return svg("g", {}, svg("line", { x1: x(i), x2: x(i), y1: y(0), y2: y(1), class: "axis" }),
        svg("text", { x: x(i), y: i % 2 ? 14 : 28, "text-anchor": "middle" }, axis.title),
        axis.ticks.map(([share, text]) => svg("text", { x: x(i) + 6, y: y(share) + 4 }, text)), mark, hit);
    });
    figure.replaceChildren(svg("g", {}, shown.lines.map(({ element }) => element)), ...parts);
    if (!limits.contains(document.activeElement)) fill(limits, axes.filter((axis) => axis.limits).map(limit));
    paint();
  }
  let newest = null;
  for (const name of ["theme", "resize"]) addEventListener(name, () => newest && draw(newest));
  return { card, draw: (what) => draw((newest = what)) };
}
