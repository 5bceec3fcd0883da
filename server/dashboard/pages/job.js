// One job: where it stands, its curves, its responses, how it looked.

import { follow, now, once, post, read } from "../api.js";
import { fill, fillOnce, h } from "../dom.js";
import { duration, factor, moment, number, short, titled } from "../format.js";
import { level } from "../measures.js";
import { action, facts, fault, state, table } from "../parts.js";
import { outputsOf } from "../outputs.js";
import { player } from "../playback/player.js";
import { curveKey, curvesOf, linePlot } from "../plots/curves.js";
import { panel } from "../plots/plot.js";

const ENDED = ["succeeded", "failed", "cancelled"];

export async function show(main, id) {
  const at = `/v1/jobs/${id}`;
  let job = await read(at);
  const [head, trouble, plots, rest] = [h("div"), h("div"), h("div", { class: "grid" }), h("div")];
  const watch = h("div"), title = h("h1"), bar = h("div", { class: "row" });
  main.append(h("div", { class: "row spread" }, title, bar), head, trouble, watch, plots, rest);

  function drawHead() {
    const name = job.sweep_id ? `Point ${job.point}, seed ${job.seed}` : `Job ${short(job.id)}`;
    document.title = `${name} · Roost`;
    const levels = Object.entries(job.factors).map(([pointer, value]) => [factor(pointer, Object.keys(job.factors)), number(level(value))]);
    const took = job.started_at && ((job.ended_at ? Date.parse(job.ended_at) : now()) - Date.parse(job.started_at)) / 1000;
    title.textContent = name;
    fillOnce(bar, job.state, () => actions(job, at));
    fill(head,
      h("div", { class: "row" }, state(job.state, job.cancelling ? "cancelling" : undefined),
        job.sweep_id && h("a", { href: `/sweeps/${job.sweep_id}` }, "its sweep"), job.from_cache && h("span", {}, "from the store: the same physics had been run"),
        h("a", { href: `/compare?jobs=${job.id}` }, "compare")),
      job.failure_class && h("p", { class: "fault" }, `${job.failure_class}: ${job.failure_message ?? ""}`),
      job.progress && h("div", { class: "bar large", role: "progressbar", "aria-valuemin": 0, "aria-valuemax": 100, "aria-valuenow": Math.floor(100 * job.progress.fraction), "aria-label": "progress of the attempt" },
        h("span", { class: "running", style: { "--part": `${100 * job.progress.fraction}%` } })),
      job.progress && facts([["Phase", job.progress.phase], ["Belt time", `${number(job.progress.time_s, 3)} s`], ["Sub-particles", number(job.progress.subparticles)],
        ["Out so far", `${number(job.progress.discharged_kg)} kg`],
        ["Speed", job.progress.wall_s > 0 ? `${number(job.progress.particle_steps / job.progress.wall_s / 1e6, 3)} million particle-steps/s` : null],
        ["Left", job.progress.fraction > 0 ? duration((job.progress.wall_s * (1 - job.progress.fraction)) / job.progress.fraction) : null]]),
      facts([...levels, ["Attempt", job.attempt], ["Submitted", moment(job.submitted_at)], ["Started", job.started_at && moment(job.started_at)],
        ["Ended", job.ended_at && moment(job.ended_at)], ["Took", took ? duration(took) : null]]));
  }

  const panels = new Map();
  function drawCurve(data) {
    if (!panels.has(curveKey(data))) {
      panels.set(curveKey(data), panel(titled(data.name, data.unit)));
      plots.append(panels.get(curveKey(data)).card);
    }
    panels.get(curveKey(data)).draw(() => linePlot([{ name: data.name, data }]));
  }

  /** What a running job has sampled so far: each part replaces what there was from its place on. */
  const sampled = new Map();
  function drawSamples({ series }) {
    if (ENDED.includes(job.state)) return;
    for (const { name, unit, from, t_s, values } of series) {
      const before = sampled.get(name) ?? { t_s: [], values: [] };
      const data = { name, unit, t_s: [...before.t_s.slice(0, from), ...t_s], values: [...before.values.slice(0, from), ...values] };
      sampled.set(name, data);
      drawCurve(data);
    }
  }

  const failed = (error) => fill(trouble, error ? fault(error) : []);

  // A job that runs again has no result any more, and may come to another.
  const keyOfResult = () => `${ENDED.includes(job.state) ? job.state : "under way"} ${job.attempt}`;
  const drawResult = once(async (key) => {
    if (!ENDED.includes(job.state)) {
      panels.clear();
      sampled.clear();
      plots.replaceChildren();
      rest.replaceChildren();
      return;
    }
    if (job.attempt === 0 && !job.from_cache) return;
    const result = await read(`${at}/result`).catch((error) => (error.status === 404 ? null : Promise.reject(error)));
    const outputs = result && (await outputsOf(result.scenario.experiment));
    if (!result || key !== keyOfResult()) return;
    for (const data of curvesOf(result)) drawCurve(data);
    fill(rest, responses(result, outputs), machine(result), document_(result, job));
  }, failed);

  const keyOfFrames = () => (job.frames ? `frames ${job.attempt}` : "none");
  let playing = null;
  const drawFrames = once(async (key) => {
    const next = job.frames ? await player(`${at}/frames`) : null;
    if (key !== keyOfFrames()) return next?.end();
    playing?.end();
    playing = next;
    watch.replaceChildren(...(playing ? [playing.element] : []));
  }, failed);

  const update = (told) => {
    job = told;
    drawHead();
    drawResult(keyOfResult());
    drawFrames(keyOfFrames());
  };
  update(job);
  follow(at, update, { samples: drawSamples }, failed);
}

function actions(job, at) {
  return [
    !ENDED.includes(job.state) && action("Cancel", () => post(`${at}/cancel`), { ask: () => "Cancel this job?" }),
    ["failed", "cancelled"].includes(job.state) && action("Retry", () => post(`${at}/retry`)),
    ENDED.includes(job.state) && h("a", { href: `${at}/result`, download: `${job.id}.json` }, "Result document"),
  ];
}

function responses(result, outputs) {
  const row = (name) => outputs.responses.find((one) => one.name === name);
  const rows = Object.entries(result.responses);
  if (rows.length === 0) return h("p", { class: "dim" }, "No responses: the run did not end by itself.");
  return h("section", { class: "card wide" }, h("h2", {}, "Responses"), table(`The run ended: ${result.end_reason.replaceAll("_", " ")}`, [
    { title: "Response", cell: ([name]) => h("span", { title: row(name)?.meaning }, titled(name, row(name)?.unit)) },
    { title: "Value", is_number: true, cell: ([, value]) => (typeof value === "string" ? value.replaceAll("_", " ") : number(value, 5)) },
    { title: "Name", cell: ([name]) => h("code", {}, name) },
  ], rows));
}

function machine({ solver, performance, instability }) {
  return h("section", { class: "card" }, h("h2", {}, "What computed it"),
    instability && h("p", { class: "fault" }, `Unstable at ${number(instability.time_s)} s, step ${number(instability.step)}: ${instability.reason}`),
    facts([["Backend", solver.backend], ["Device", solver.device], ["Threads", solver.threads], ["Revision", solver.revision], ["Time step", `${number(1e6 * solver.timestep_s)} µs`],
      ["Steps", number(performance.steps)], ["Sub-particles", number(performance.subparticles)], ["Wall time", duration(performance.wall_s)],
      ["A particle-step", `${number(performance.ns_per_particle_step, 3)} ns`]]));
}

function document_(result, job) {
  return h("details", { class: "card" }, h("summary", {}, "Scenario as run"), h("p", { class: "mono dim" }, `digest ${job.scenario_digest}`),
    h("pre", { class: "mono" }, JSON.stringify(result.scenario, null, 2)));
}
