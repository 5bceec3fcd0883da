// @ts-check
// One job: state, progress, curves, responses and playback.

import { follow, now, post, read, readIfThere, runLatest } from "../api.js";
import { fill, fillIfChanged, h } from "../dom.js";
import { duration, factorLabel, dateTime, number, shortId, labelOf } from "../format.js";
import { level } from "../measures.js";
import { isPerBody, readOutputs } from "../outputs.js";
import { action, bar as progressBar, errorBox, facts, isEnded, requested, responseLabel, state, table } from "../parts.js";
import { player } from "../playback/player.js";
import { curveKey, curvesOf, linePlot } from "../plots/curves.js";
import { panel } from "../plots/plot.js";
import { forecastOf } from "../sections/forecast.js";

/** @param {HTMLElement} main @param {string} id */
export async function show(main, id) {
  const at = `/v1/jobs/${id}`;
  /** @type {JobView} */
  let job = await read(at);
  const [head, errors, plots, rest] = [h("div"), h("div"), h("div", { class: "grid" }), h("div")];
  const forecast = forecastOf(at), playback = h("div"), title = h("h1"), bar = h("div", { class: "row" });
  main.append(h("div", { class: "row spread" }, title, bar), head, forecast.element, errors, playback, plots, rest);

  function drawHead() {
    const name = job.sweep_id ? `Point ${job.point}, seed ${job.seed}` : `Job ${shortId(job.id)}`;
    document.title = `${name} · Roost`;
    const levels = Object.entries(job.factors).map(([pointer, value]) => /** @type {[string, Child]} */ ([factorLabel(pointer, Object.keys(job.factors)), number(level(value))]));
    const took = job.started_at && ((job.ended_at ? Date.parse(job.ended_at) : now()) - Date.parse(job.started_at)) / 1000;
    title.textContent = name;
    fillIfChanged(bar, `${job.state} ${job.paused}`, () => actions(job, at));
    fill(head,
      h("div", { class: "row" }, state(job.state, requested(job)),
        job.sweep_id && h("a", { href: `/sweeps/${job.sweep_id}` }, "sweep"), job.from_cache && h("span", {}, "cached result of an equal scenario"),
        h("a", { href: `/compare?jobs=${job.id}` }, "compare")),
      job.failure_class && h("p", { class: "fault" }, `${job.failure_class}: ${job.failure_message ?? ""}`),
      job.progress && progressBar("progress of the attempt", Math.floor(100 * job.progress.fraction), [["running", job.progress.fraction]], true),
      job.progress && facts([["Phase", job.progress.phase], ["Belt time", `${number(job.progress.time_s, 3)} s`], ["Sub-particles", number(job.progress.subparticles)],
        ["Discharged", `${number(job.progress.discharged_kg)} kg`],
        ["Speed", job.progress.wall_s > 0 ? `${number(job.progress.particle_steps / job.progress.wall_s / 1e6, 3)} million particle-steps/s` : null],
        ["Left", job.progress.fraction > 0 ? duration((job.progress.wall_s * (1 - job.progress.fraction)) / job.progress.fraction) : null]]),
      facts([...levels, ["Attempt", job.attempt], ["Continues from", typeof job.resumed_from_s === "number" ? `${number(job.resumed_from_s, 3)} s of simulated time` : null],
        ["Fill", job.filled_by === "shared" ? "of another run" : job.filled_by === "attempt" ? "its own" : null],
        ["Checkpoint", job.checkpoint ? `at ${number(job.checkpoint.simulated_s, 3)} s, ${number(job.checkpoint.bytes / 2 ** 20, 3)} MiB` : null], ["Submitted", dateTime(job.submitted_at)], ["Started", job.started_at && dateTime(job.started_at)],
        ["Ended", job.ended_at && dateTime(job.ended_at)], ["Duration", took ? duration(took) : null]]));
  }

  /** @type {Map<string, ReturnType<typeof panel>>} */
  const panels = new Map();
  /** @param {Series | Curve} data @param {boolean} is_per_body */
  function drawCurve(data, is_per_body) {
    const plot = panels.get(curveKey(data)) ?? panel(labelOf(data.name, data.unit));
    if (!panels.has(curveKey(data))) plots.append(plot.card);
    panels.set(curveKey(data), plot);
    plot.draw(() => linePlot([{ name: data.name, data }], is_per_body));
  }

  /**
   * The series of a running job over simulated time, each from its first sample on.
   * @type {Map<string, SeriesPart>}
   */
  const sampled = new Map();
  /** @param {{ t0_s: number | null, series: SeriesPart[] }} event */
  function drawSamples({ t0_s, series }) {
    if (isEnded(job.state)) return;
    for (const { name, unit, from, t_s, values } of series) {
      // A stream that was opened again begins with the first sample.
      const before = sampled.get(name) ?? { t_s: [], values: [] };
      sampled.set(name, { name, unit, from: 0, t_s: [...before.t_s.slice(0, from), ...t_s], values: [...before.values.slice(0, from), ...values] });
    }
    const all = [...sampled.values()];
    // While t = 0 is unknown, times end at 0.
    const zero_s = t0_s ?? Math.max(...all.map(({ t_s }) => t_s.at(-1) ?? 0));
    for (const { name, unit, t_s, values } of all) drawCurve({ name, unit, t_s: t_s.map((simulated_s) => simulated_s - zero_s), values }, false);
  }

  const failed = (/** @type {Error | null} */ error) => fill(errors, error ? errorBox(error) : []);

  // A retried job has no result until its new attempt ends.
  const resultKey = () => `${isEnded(job.state) ? job.state : "not ended"} ${job.attempt}`;
  const drawResult = runLatest(async (key) => {
    if (!isEnded(job.state)) {
      panels.clear();
      sampled.clear();
      plots.replaceChildren();
      rest.replaceChildren();
      return;
    }
    if (job.attempt === 0 && !job.from_cache) return;
    /** @type {[RunResult | null, OutputTable]} */
    const [result, outputs] = await Promise.all([readIfThere(`${at}/result`), readOutputs()]);
    if (!result || key !== resultKey()) return;
    for (const data of curvesOf(result)) drawCurve(data, isPerBody(outputs, data));
    fill(rest, warnings(result), responses(result, outputs), computation(result), scenario(result, job));
  }, failed);

  const framesKey = () => (job.frames ? `frames ${job.attempt}` : "none");
  /** @type {Awaited<ReturnType<typeof player>>} */
  let playing = null;
  const drawFrames = runLatest(async (key) => {
    const next = job.frames ? await player(`${at}/frames`) : null;
    if (key !== framesKey()) return next?.end();
    playing?.end();
    playing = next;
    playback.replaceChildren(...(playing ? [playing.element] : []));
  }, failed);

  const update = (/** @type {JobView} */ view) => {
    job = view;
    drawHead();
    forecast.update(isEnded(job.state));
    drawResult(resultKey());
    drawFrames(framesKey());
  };
  update(job);
  follow(at, update, { samples: drawSamples }, failed);
}

/** @param {JobView} job @param {string} at */
function actions(job, at) {
  return [
    !isEnded(job.state) && (job.paused ? action("Resume", () => post(`${at}/resume`)) : action("Pause", () => post(`${at}/pause`))),
    !isEnded(job.state) && action("Cancel", () => post(`${at}/cancel`), { ask: () => "Cancel this job?" }),
    ["failed", "cancelled"].includes(job.state) && action("Retry", () => post(`${at}/retry`)),
    isEnded(job.state) && h("a", { href: `${at}/result`, download: `${job.id}.json` }, "Result document"),
  ];
}

/** Results of older solvers have none. @param {RunResult} result */
function warnings({ warnings = [] }) {
  return warnings.length > 0 && h("section", { class: "card wide" }, h("h2", {}, "Warnings"),
    h("ul", {}, warnings.map(({ code, message }) => h("li", {}, h("code", {}, code), ` ${message}`))));
}

/** @param {RunResult} result @param {OutputTable} outputs */
function responses(result, outputs) {
  const rows = Object.entries(result.responses);
  if (rows.length === 0) return h("p", { class: "dim" }, "No responses: the simulation was stopped before its end.");
  return h("section", { class: "card wide" }, h("h2", {}, "Responses"), table(`End reason: ${result.end_reason.replaceAll("_", " ")}`, [
    { title: "Response", cell: ([name]) => responseLabel(outputs, name) },
    { title: "Value", is_number: true, cell: ([, value]) => (typeof value === "string" ? value.replaceAll("_", " ") : number(value, 5)) },
    { title: "Name", cell: ([name]) => h("code", {}, name) },
  ], rows));
}

/** @param {RunResult} result */
function computation({ solver, performance, instability }) {
  return h("section", { class: "card" }, h("h2", {}, "Computation"),
    instability && h("p", { class: "fault" }, `Unstable at ${number(instability.time_s)} s, step ${number(instability.step)}: ${instability.reason}`),
    facts([["Backend", solver.backend], ["Device", solver.device], ["Threads", solver.threads], ["Revision", solver.revision], ["Time step", `${number(1e6 * solver.timestep_s)} µs`],
      ["Steps", number(performance.steps)], ["Sub-particles", number(performance.subparticles)], ["Wall time", duration(performance.wall_s)],
      ["Time per particle-step", `${number(performance.ns_per_particle_step, 3)} ns`]]));
}

/** @param {RunResult} result @param {JobView} job */
function scenario(result, job) {
  return h("details", { class: "card" }, h("summary", {}, "Scenario with all defaults"), h("p", { class: "mono dim" }, `digest ${job.scenario_digest}`),
    h("pre", { class: "mono" }, JSON.stringify(result.scenario, null, 2)));
}
