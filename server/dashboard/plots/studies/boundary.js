// @ts-check
// The boundary: over one factor the estimate with its band, the level and its crossings; over two a map with the boundary and its band. With
// more factors the map is a slice. All numbers are those of the answer.

import { fill, h } from "../../dom.js";
import { number } from "../../format.js";
import { choice, table } from "../../parts.js";
import { colour, LEGEND, panel, transparent } from "../plot.js";
import { errorBars, factorAxis, factorColumns, intervalText, levelLine, placeText, sizedByRuns, wholeRange } from "./labels.js";

/** @typedef {{ factors: StudyFactor[], name: string, is_share: boolean, finding: BoundaryFinding }} BoundaryInput */

/** @param {import("./pictures.js").PictureInput} input */
export function boundaryPictures({ goal, factors, label }) {
  const input = { factors, name: label(goal.of), is_share: "probability" in goal.of };
  const place = h("div", { class: "row" });
  const plot = panel("Boundary", { size: "tall-plot", is_wide: true, controls: factors.length > 2 ? [place] : [], empty_text: "No estimate yet: the first points have too few results." });
  /** @type {BoundaryFinding | undefined} */
  let newest;
  /** The value of each factor in the slice; null along both axes. @type {(number | null)[]} */
  let slice = [];
  const draw = (/** @type {BoundaryFinding} */ finding) => {
    newest = finding;
    if (factors.length === 1) return plot.draw(() => overFactor({ ...input, finding }));
    const levels = factors.map((_, i) => [...new Set(finding.map.map(({ values }) => values[i]))].sort((a, b) => a - b));
    if (slice.length === 0 && finding.map.length > 0) slice = levels.map((all, i) => (i < 2 ? null : all[Math.floor(all.length / 2)]));
    if (factors.length > 2 && !place.contains(document.activeElement)) fill(place, sliceChoices(levels));
    return plot.draw(() => overTwo({ ...input, finding }, slice));
  };
  /** @param {number[][]} levels of the map */
  function sliceChoices(levels) {
    return slice.map((value, i) => choice(factors[i].label, [["", "along an axis"], ...levels[i].map((level) => /** @type {Option} */ ([String(level), number(level)]))], value === null ? "" : String(value), (text) => {
      slice = changedSlice(slice, i, text === "" ? null : Number(text), levels);
      fill(place, sliceChoices(levels));
      place.querySelectorAll("select")[i].focus();
      if (newest) draw(newest);
    }));
  }
  return [{ card: plot.card, draw }];
}

/**
 * The slice after a choice for factor i: a value, or null for a place along an axis. Two factors are along the axes, so another factor leaves
 * or joins them.
 * @param {(number | null)[]} slice @param {number} i @param {number | null} value @param {number[][]} levels of the map
 */
export function changedSlice(slice, i, value, levels) {
  const next = slice.map((one, k) => (k === i ? value : one)), along = next.filter((one) => one === null).length;
  const other = next.findIndex((one, k) => k !== i && (along > 2 ? one === null : one !== null));
  if (along !== 2) next[other] = along > 2 ? levels[other][Math.floor(levels[other].length / 2)] : null;
  return next;
}

/** @param {BoundaryFinding["observed"]} observed @param {StudyFactor[]} factors @param {string} name */
const observedText = (observed, factors, name) => observed.map(({ values, estimated }) => `${placeText(factors, values)}<br>${name} ${number(estimated.value)}, n = ${estimated.n}<br>95 %: ${intervalText(estimated)}`);

/** @param {BoundaryInput} input @returns {Plot} */
function overFactor({ factors, name, is_share, finding }) {
  const { map, observed, level, crossings } = finding, x = map.map(({ values }) => values[0]);
  const edge = { type: "scatter", mode: "lines", x, line: { width: 0 }, hoverinfo: "skip", legendgroup: "band" };
  const band = [
    { ...edge, name: "low", showlegend: false, y: map.map(({ low }) => low) },
    { ...edge, name: "95 % band", fill: "tonexty", fillcolor: transparent(colour("c0"), 0.22), y: map.map(({ high }) => high) },
    { type: "scatter", mode: "lines", name: "estimate", x, y: map.map(({ estimate }) => estimate), line: { color: colour("c0"), width: 2.2 },
      text: map.map((point) => `${placeText(factors, point.values)}<br>${name} ${number(point.estimate)}<br>band: ${intervalText(point)}`), hoverinfo: "text" },
  ];
  const stretch = (/** @type {boolean} */ is_certain, /** @type {string} */ title) => {
    const all = crossings.filter((one) => one.is_certain === is_certain);
    return { type: "scatter", mode: "lines", name: title, x: all.flatMap(({ low, high }) => [low, high, null]), y: all.flatMap(() => [level, level, null]), line: { color: colour("c1"), width: is_certain ? 6 : 3, dash: is_certain ? "solid" : "dot" },
      text: all.flatMap((one) => Array(3).fill(`${title}<br>${factors[0].label} ${intervalText(one)}`)), hoverinfo: "text" };
  };
  const estimates = crossings.flatMap((one) => one.estimates.map((at) => ({ at, one })));
  const points = { type: "scatter", mode: "markers", name: "runs at a point, 95 % interval", x: observed.map(({ values }) => values[0]), y: observed.map(({ estimated }) => estimated.value),
    marker: { ...sizedByRuns(observed.map(({ estimated }) => estimated.n)), color: colour("c7"), opacity: 1, line: { color: colour("raised"), width: 1 } },
    error_y: errorBars(observed.map(({ estimated }) => estimated), colour("c7")), text: observedText(observed, factors, name), hoverinfo: "text" };
  const marks = { type: "scatter", mode: "markers", name: "estimated crossing", x: estimates.map(({ at }) => at), y: estimates.map(() => level), marker: { color: colour("c1"), size: 12, symbol: "diamond", line: { color: colour("raised"), width: 1.5 } },
    text: estimates.map(({ at, one }) => `crosses at ${factors[0].label} ${number(at)}<br>95 %: ${intervalText(one)}`), hoverinfo: "text" };
  const traces = [...(map.length > 0 ? band : []), points, stretch(true, "crossing, 95 % interval"), stretch(false, "perhaps a crossing"), marks];
  return {
    traces: traces.filter((trace) => trace.x.length > 0),
    layout: { legend: { ...LEGEND, itemsizing: "constant" }, xaxis: factorAxis(factors[0]), yaxis: { title: { text: name }, ...(is_share && { range: [-0.05, 1.05] }) }, ...levelLine(level, `level ${number(level)}`) },
    table: () => h("div", {}, table("Crossings of the level", [
      { title: factors[0].label, is_number: true, cell: ({ estimates }) => estimates.map((at) => number(at)).join(", ") || "–" },
      { title: "95 % interval", is_number: true, cell: intervalText },
      { title: "Certain", cell: ({ is_certain }) => (is_certain ? "yes" : "no") },
    ], crossings), observedTable({ factors, name, observed })),
    note: "The mark of a point grows with its number of runs.",
  };
}

/** @param {{ factors: StudyFactor[], name: string, observed: BoundaryFinding["observed"] }} input */
function observedTable({ factors, name, observed }) {
  return table("Points with results", [
    ...factorColumns(factors), { title: "Runs", is_number: true, cell: ({ estimated }) => estimated.n },
    { title: name, is_number: true, cell: ({ estimated }) => number(estimated.value) }, { title: "95 % interval", is_number: true, cell: ({ estimated }) => intervalText(estimated) },
  ], observed);
}

/**
 * A map over the two factors along the axes, at the slice's values of the others.
 * @param {BoundaryInput} input @param {(number | null)[]} slice @returns {Plot | null}
 */
function overTwo({ factors, name, is_share, finding }, slice) {
  const { map, observed, level } = finding;
  const inside = map.filter(({ values }) => slice.every((value, i) => value === null || values[i] === value));
  const [a, b] = slice.flatMap((value, i) => (value === null ? [i] : []));
  if (inside.length === 0 || b === undefined) return null;
  const along = (/** @type {number} */ i) => [...new Set(inside.map(({ values }) => values[i]))].sort((one, other) => one - other);
  const [x, y] = [along(a), along(b)], found = new Map(inside.map((point) => [`${point.values[a]} ${point.values[b]}`, point]));
  /**
   * @template T
   * @param {(point: MapPoint) => T} of
   */
  const grid = (of) => y.map((up) => x.map((across) => of(/** @type {MapPoint} */ (found.get(`${across} ${up}`)))));
  const contour = { type: "contour", x, y, showscale: false, showlegend: true, hoverinfo: "skip", autocontour: false };
  const traces = [
    // Without smoothing plotly.js sets a style that the content security policy refuses.
    { type: "heatmap", name, x, y, z: grid(({ estimate }) => estimate), zsmooth: "best", ...(is_share && { zmin: 0, zmax: 1 }), colorscale: is_share ? [[0, colour("c0")], [0.5, colour("c4")], [1, colour("c1")]] : "Viridis",
      colorbar: { title: { text: name, side: "right" }, thickness: 12 }, text: grid((point) => `${placeText(factors, point.values)}<br>${name} ${number(point.estimate)}<br>band: ${intervalText(point)}`), hoverinfo: "text" },
    // The level is in the band where it is between both ends: there this is positive. plotly.js leaves the part free that meets the constraint.
    { ...contour, name: "band: the side is not known", z: grid(({ low, high }) => Math.min(high - level, level - low)), contours: { type: "constraint", operation: "<", value: 0 }, fillcolor: transparent(colour("ground"), 0.5), line: { color: colour("text"), width: 1.4, dash: "dash" } },
    { ...contour, name: `boundary at ${number(level)}`, z: grid(({ estimate }) => estimate), contours: { start: level, end: level, size: 1, coloring: "none" }, line: { color: colour("text"), width: 3 } },
    ...(factors.length > 2 ? [] : [{ type: "scatter", mode: "markers", name: "points", cliponaxis: false, x: observed.map(({ values }) => values[a]), y: observed.map(({ values }) => values[b]),
      marker: { ...sizedByRuns(observed.map(({ estimated }) => estimated.n)), color: colour("text"), opacity: 1, line: { color: colour("raised"), width: 1.5 } }, text: observedText(observed, factors, name), hoverinfo: "text" }]),
  ];
  return {
    traces, layout: { legend: { ...LEGEND, itemsizing: "constant" }, xaxis: { ...factorAxis(factors[a]), ...wholeRange(factors[a]) }, yaxis: { ...factorAxis(factors[b]), ...wholeRange(factors[b]) } },
    table: () => observedTable({ factors, name, observed }),
    note: `In the band the side of the boundary is not known with 95 % confidence. ${factors.length > 2 ? "The map is a slice; points with results are in the table." : "The mark of a point grows with its number of runs."}`,
  };
}
