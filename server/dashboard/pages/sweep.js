// @ts-check
// One sweep: progress, responses over the factors, effects, curves, design points and jobs.

import { follow, isTemporary, joinViews, mapConcurrently, read } from "../api.js";
import { fill, h } from "../dom.js";
import { factorLabel } from "../format.js";
import { measures, preferred } from "../measures.js";
import { headlineOf, readOutputsOf, seriesRows } from "../outputs.js";
import { choice, errorBox, jobsPath, parameter, setParameters, total } from "../parts.js";
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

/** Trials that are drawn one by one; a sweep with more has none. */
const MAX_DOTS = 3000;
/** Design points that are read and drawn. */
const MAX_POINTS = 4000;
/** With more design points than this, only the responses that plots need are read. */
const MAX_COMPLETE_POINTS = 500;
/** Jobs whose curves the experiment's own plot draws. */
const MAX_CURVES = 40;
/** Pause between a change and the next read of results: at least this long, and at least this many times the duration of a read. */
const PAUSE_MS = 3000, PAUSE_READS = 8;

/** @param {HTMLElement} main @param {string} id */
export async function show(main, id) {
  const at = `/v1/sweeps/${id}`;
  /** @type {[SweepView, SweepSpec]} */
  let [sweep, { base }] = await Promise.all([read(at), read(`${at}/spec`)]);
  const experiment = String(base.experiment), form = formOf(experiment), outputs = await readOutputsOf(experiment);
  const headline = headlineOf(outputs).map((row) => row.name), plotted = headlineOf(outputs).find((row) => row.type === "number")?.name, series_rows = seriesRows(outputs);
  /** @type {Pick<SweepData, "points" | "trials" | "effects" | "curves"> & { pairing?: PairingGain }} */
  const results = { points: [], trials: [], effects: [], curves: [] };
  const views = joinViews(update, (view) => {
    update(view);
    readAgain(0);
  });
  const top = head(at, sweep, views.answer);
  const title = h("h1", {}, sweep.name), errors = h("div"), controls = h("div", { class: "row card" });
  // A sweep without factors never has plots over a factor.
  const options = sweep.factors.length > 0 ? {} : { empty_text: null };
  const own_place = h("div"), response = panel("Response against factor", options), map = panel("Map over two factors", { empty_text: null }), effect = panel("Main effects", options);
  const surface = panel("Response surface", { empty_text: null }), coordinates = parallel(), points = pointsTable();
  const series = curves(at, sweep);
  main.append(h("div", { class: "row spread" }, title, top.bar), top.element, errors, controls, own_place,
    h("div", { class: "grid" }, response.card, map.card, effect.card, surface.card, series.card), coordinates.card, points.card, jobsTable(`${at}/jobs`));

  const chosen = { response: parameter("response"), map: parameter("map"), x: parameter("x"), y: parameter("y") };
  const choose = (/** @type {keyof typeof chosen} */ key) => (/** @type {string} */ value) => {
    chosen[key] = value;
    setParameters(chosen);
    draw().catch(failed);
  };

  /**
   * The page behind a design point: its job, the comparison of its jobs, or their rows in the table.
   * @param {PointRow} row
   */
  function pathOf(row) {
    return jobsPath(results.trials.filter((trial) => trial.point === row.point).map((trial) => trial.job_id)) ?? `/sweeps/${id}?point=${row.point}#jobs`;
  }

  /** @type {ReturnType<typeof panel> | undefined} */
  let own_plot;
  /**
   * Draws the experiment's own plot, of its first numeric response in the headline.
   * @param {SweepData & { x: string | undefined }} data @param {Measure[]} all
   */
  function drawForm(data, all) {
    const { plot, title = "", over, curve } = form;
    const measure = all.find((one) => one.name === plotted);
    if (!plot || !measure || !(data.x || curve)) return;
    if (!own_plot) fill(own_place, (own_plot = panel(title, { size: "tall-plot" })).card);
    const x = over && sweep.factors.includes(over) && chosen.x === null ? over : (data.x ?? "");
    own_plot.draw(() => plot({ ...data, x, measure }));
  }

  /** Draws all results; ends when the curves have been read and drawn. */
  async function draw() {
    const all = measures(results.points, outputs), factors = sweep.factors;
    const named = (/** @type {string | null} */ name) => all.find((one) => one.name === name);
    const measure = named(chosen.response) ?? preferred(all, headline) ?? all[0];
    const map_measure = named(chosen.map) ?? preferred(all, form.failures) ?? measure;
    /** @type {string | undefined} */
    const x = factors.find((pointer) => pointer === chosen.x) ?? factors[0];
    const y = factors.find((pointer) => pointer === chosen.y && pointer !== x) ?? factors.find((pointer) => pointer !== x);
    const options = all.map((one) => /** @type {Option} */ ([one.name, one.label])), pointers = factors.map((pointer) => /** @type {[string, string]} */ ([pointer, factorLabel(pointer, factors)]));
    if (!measure) {
      fill(controls, h("p", { class: "dim" }, "No results yet. Plots appear when the first job succeeds."));
      return series.draw(series_rows, results.points);
    }
    if (!controls.contains(document.activeElement)) {
      fill(controls, choice("Response", options, measure.name, choose("response")), y && choice("Map of", options, map_measure.name, choose("map")),
        x && choice("Across", pointers, x, choose("x")), y && choice("By", pointers.filter(([pointer]) => pointer !== x), y, choose("y")),
        sweep.points > results.points.length && h("span", { class: "dim" }, `the first ${results.points.length.toLocaleString("en")} of ${sweep.points.toLocaleString("en")} design points`));
    }
    const data = { ...results, factors, path: pathOf };
    response.draw(() => (x ? responsePlot({ ...data, x, measure, by: y }) : null));
    map.draw(() => (y ? mapPlot({ ...data, x, measure: map_measure, y }) : null));
    effect.draw(() => (x ? effectsPlot({ effects: results.effects.find((one) => one.response === measure.name), pairing: results.pairing, factors, label: measure.label }) : null));
    surface.draw(() => (y ? surfacePlot({ ...data, x, measure, y }) : null));
    coordinates.draw({ ...data, measure });
    points.draw({ ...data, all, headline });
    drawForm({ ...data, x }, all);
    return series.draw(series_rows, results.points);
  }

  /**
   * The named curve of each trial, from its result document.
   * @param {TrialRow[]} trials @param {string} name @returns {Promise<TrialCurve[]>}
   */
  async function curvesOf(trials, name) {
    const done = trials.filter((trial) => trial.state === "succeeded").slice(0, MAX_CURVES);
    return mapConcurrently(done, async (trial) => {
      /** @type {RunResult} */
      const result = await read(`/v1/jobs/${trial.job_id}/result`);
      return { trial, curve: result.curves?.find((curve) => curve.name === name) };
    });
  }

  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  let took_ms = 0, reads = 0;
  /** No pause after the last job: no later change will start a read. */
  const pause = () => (sweep.counts.queued + sweep.counts.running > 0 ? Math.max(PAUSE_MS, PAUSE_READS * took_ms) : 0);
  function readAgain(wait_ms = pause()) {
    if (wait_ms === 0) {
      clearTimeout(timer);
      timer = undefined;
    }
    timer ??= setTimeout(load, wait_ms);
  }
  const failed = (/** @type {any} */ error) => fill(errors, error ? errorBox(error) : []);
  async function load() {
    timer = undefined;
    if (document.hidden) return readAgain(PAUSE_MS);
    const began = performance.now(), mine = ++reads;
    const query = new URLSearchParams({ by: "point", limit: String(MAX_POINTS) });
    if (sweep.points > MAX_COMPLETE_POINTS) query.set("responses", responsesOf(form, headline, [chosen.response, chosen.map]));
    try {
      /** @type {[SweepPoints, SweepEffects, Pick<SweepResults, "trials">]} */
      const [byPoint, effects, byTrial] = await Promise.all([read(`${at}/results?${query}`), read(`${at}/effects`),
        total(sweep.counts) <= MAX_DOTS ? read(`${at}/results`) : { trials: [] }]);
      const curves = form.curve ? await curvesOf(byTrial.trials, form.curve) : [];
      // A later read has begun: its answer is newer.
      if (mine < reads) return;
      Object.assign(results, { points: byPoint.points, effects: effects.responses, pairing: effects.pairing, trials: byTrial.trials, curves });
      await draw();
      failed(null);
    } catch (error) {
      failed(error);
      if (isTemporary(error)) readAgain(PAUSE_MS);
    }
    took_ms = performance.now() - began;
  }

  /** @param {SweepView} view */
  function update(view) {
    // Changes while the page was hidden or the stream was broken have no event.
    const is_changed = JSON.stringify(view.counts) !== JSON.stringify(sweep.counts);
    sweep = view;
    top.draw(view);
    if (is_changed) readAgain();
  }
  update(sweep);
  load();
  follow(at, views.arrive, { change: () => readAgain(), extended: () => readAgain(0) }, failed);
}
