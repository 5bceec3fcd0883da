// One sweep: how far it is, what came out, which design is best, and where it jams.

import { each, follow, passes, read } from "../api.js";
import { fill, h } from "../dom.js";
import { factor } from "../format.js";
import { measures, preferred } from "../measures.js";
import { headline, outputsOf, seriesNames } from "../outputs.js";
import { asked, choice, fault, pathTo, remember, total } from "../parts.js";
import { effectsPlot } from "../plots/effects.js";
import { formOf, responsesOf } from "../plots/forms/forms.js";
import { mapPlot } from "../plots/map.js";
import { parallel } from "../plots/parallel.js";
import { panel } from "../plots/plot.js";
import { responsePlot } from "../plots/response.js";
import { surfacePlot } from "../plots/surface.js";
import { curves } from "../sections/curves.js";
import { head } from "../sections/head.js";
import { jobsTable, pointsTable } from "../sections/tables.js";

/** Trials of larger sweeps are not drawn one by one. */
const MOST_DOTS = 3000;
/** Design points that are fetched and drawn. */
const MOST_POINTS = 4000;
/** Of more design points than this only what is asked first is fetched. */
const FEW_POINTS = 500;
/** Jobs whose curves the form of an experiment draws. */
const MOST_CURVES = 40;
/** Results are read again this long after something has changed, and not before so many times of what reading took. */
const REST_MS = 3000, REST_TIMES = 8;

export async function show(main, id) {
  const at = `/v1/sweeps/${id}`;
  let [sweep, { base }] = await Promise.all([read(at), read(`${at}/spec`)]);
  const outputs = await outputsOf(base.experiment), told = formOf(base.experiment), first = headline(outputs), names = seriesNames(outputs);
  const results = { points: [], trials: [], effects: [], curves: [] };
  const top = head(at, sweep, (now) => (followed(now), again(0)));
  const title = h("h1", {}, sweep.name), trouble = h("div"), controls = h("div", { class: "row card" });
  // Without factors there is nothing to draw over, ever.
  const over = sweep.factors.length > 0 ? {} : { empty: null };
  const form = h("div"), response = panel("Response against factor", over), map = panel("Map over two factors", { empty: null }), effect = panel("Main effects", over);
  const surface = panel("Response surface", { empty: null }), coordinates = parallel(), points = pointsTable();
  const series = curves(at, sweep);
  main.append(h("div", { class: "row spread" }, title, top.bar), top.element, trouble, controls, form,
    h("div", { class: "grid" }, response.card, map.card, effect.card, surface.card, series.card), coordinates.card, points.card, jobsTable(`${at}/jobs`));

  const chosen = { response: asked("response"), map: asked("map"), x: asked("x"), y: asked("y") };
  const choose = (key) => (value) => {
    chosen[key] = value;
    remember(chosen);
    draw().catch(failed);
  };

  /** Where a click on a design point leads: to its job, or to its jobs side by side, or to their rows in the table. */
  function pathOf(row) {
    return pathTo(results.trials.filter((trial) => trial.point === row.point).map((trial) => trial.job_id)) ?? `/sweeps/${id}?point=${row.point}#jobs`;
  }

  let own = null;
  /** The response that the form of the experiment plots: its first number. */
  const plotted = outputs.responses.filter((row) => row.headline && row.type === "number").map((row) => row.name).slice(0, 1);
  function drawForm(given, all) {
    if (!told.plot || !(given.x || told.curve) || !preferred(all, plotted)) return;
    if (!own) fill(form, (own = panel(told.title, { size: "tall-plot" })).card);
    const over = sweep.factors.includes(told.over) && chosen.x === null ? told.over : given.x;
    own.draw(() => told.plot({ ...given, x: over, measure: preferred(all, plotted) }));
  }

  /** Draws what there is; ends when the curves, which are read for it, are there. */
  async function draw() {
    const all = measures(results.points, outputs), factors = sweep.factors;
    const named = (name) => all.find((one) => one.name === name);
    const measure = named(chosen.response) ?? preferred(all, first) ?? all[0];
    const mapped = named(chosen.map) ?? preferred(all, told.map) ?? measure;
    const x = factors.includes(chosen.x) ? chosen.x : factors[0];
    const y = factors.includes(chosen.y) && chosen.y !== x ? chosen.y : factors.find((pointer) => pointer !== x);
    const options = all.map((one) => [one.name, one.label]), pointers = factors.map((pointer) => [pointer, factor(pointer, factors)]);
    if (!measure) {
      fill(controls, h("p", { class: "dim" }, "No results yet: plots come with the first job that succeeds."));
      return series.draw(names, results.points);
    }
    if (!controls.contains(document.activeElement)) {
      fill(controls, choice("Response", options, measure.name, choose("response")), y && choice("Map of", options, mapped.name, choose("map")),
        x && choice("Across", pointers, x, choose("x")), y && choice("By", pointers.filter(([pointer]) => pointer !== x), y, choose("y")),
        sweep.points > results.points.length && h("span", { class: "dim" }, `the first ${results.points.length.toLocaleString("en")} of ${sweep.points.toLocaleString("en")} design points`));
    }
    const given = { ...results, factors, x, path: pathOf };
    response.draw(() => (x ? responsePlot({ ...given, measure, by: y }) : null));
    map.draw(() => (y ? mapPlot({ ...given, measure: mapped, y }) : null));
    effect.draw(() => x && effectsPlot({ effects: results.effects.find((one) => one.response === measure.name), factors, label: measure.label }));
    surface.draw(() => (y ? surfacePlot({ ...given, measure, y }) : null));
    coordinates.draw({ ...given, measure });
    points.draw({ ...given, all, first });
    drawForm(given, all);
    return series.draw(names, results.points);
  }

  /** Curves over something else than time, which stand in result documents. */
  async function curvesOf(trials, name) {
    const done = trials.filter((trial) => trial.state === "succeeded").slice(0, MOST_CURVES);
    return each(done, async (trial) => ({ trial, curve: (await read(`/v1/jobs/${trial.job_id}/result`)).curves.find((curve) => curve.name === name) }));
  }

  let timer = null, took_ms = 0, reads = 0;
  /** The last change is read at once: none comes after it. */
  const rest = () => (sweep.counts.queued + sweep.counts.running > 0 ? Math.max(REST_MS, REST_TIMES * took_ms) : 0);
  function again(wait = rest()) {
    if (wait === 0) clearTimeout(timer), (timer = null);
    timer ??= setTimeout(load, wait);
  }
  const failed = (error) => fill(trouble, error ? fault(error) : []);
  async function load() {
    timer = null;
    if (document.hidden) return again(REST_MS);
    const began = performance.now(), mine = ++reads;
    const query = new URLSearchParams({ by: "point", limit: MOST_POINTS });
    if (sweep.points > FEW_POINTS) query.set("responses", responsesOf(told, first, [chosen.response, chosen.map]));
    try {
      const [byPoint, effects, byTrial] = await Promise.all([read(`${at}/results?${query}`), read(`${at}/effects`),
        total(sweep.counts) <= MOST_DOTS ? read(`${at}/results`) : { trials: [] }]);
      const { curve } = told;
      // Another read has begun since, which knows more.
      if (mine < reads) return;
      Object.assign(results, { points: byPoint.points, effects: effects.responses, trials: byTrial.trials, curves: curve ? await curvesOf(byTrial.trials, curve) : [] });
      await draw();
      failed(null);
    } catch (error) {
      failed(error);
      if (passes(error)) again(REST_MS);
    }
    took_ms = performance.now() - began;
  }

  function followed(now) {
    // What happened while nobody looked, or while the stream was broken, is told by no event.
    const is_other = JSON.stringify(now.counts) !== JSON.stringify(sweep.counts);
    sweep = now;
    top.draw(now);
    if (is_other) again();
  }
  followed(sweep);
  load();
  follow(at, followed, { change: () => again(), extended: () => again(0) }, failed);
}
