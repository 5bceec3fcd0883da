// One sweep: how far it is, what came out, which design is best, and where it jams.

import { each, follow, post, read } from "../api.js";
import { fill, fillOnce, h } from "../dom.js";
import { duration, factor, moment } from "../format.js";
import { grouped, measures, preferred } from "../measures.js";
import { action, asked, choice, counts, facts, fault, progress, remember, state, stateOfSweep, total } from "../parts.js";
import { extend, retry } from "../extend.js";
import { bandPlot } from "../plots/curves.js";
import { effectsPlot } from "../plots/effects.js";
import { mapPlot } from "../plots/map.js";
import { parallel } from "../plots/parallel.js";
import { panel } from "../plots/plot.js";
import { responsePlot } from "../plots/response.js";
import { surfacePlot } from "../plots/surface.js";
import { jobsTable, pointsTable } from "../tables.js";

/** Trials of larger sweeps are not drawn one by one. */
const MOST_DOTS = 3000;
/** Design points of larger sweeps are neither fetched nor drawn: their table has hundreds of megabytes. */
const MOST_POINTS = 4000;
/** Curves are fetched job by job. */
const MOST_CURVES = 160;
/** More groups of curves than this cannot be told apart. */
const MOST_GROUPS = 12;
/** A factor that takes more values than that is cut into so many ranges. */
const RANGES = 6;
/** Results are read again this long after something has changed. */
const REST_MS = 3000;

/** What an engineer asks first, by experiment. */
const FIRST = ["effective_throughput_kg_s", "mean_rate_kg_s", "discharged_kg", "bend_angle_deg", "critical_angle_deg", "modulus_pa", "settle_time_s"];
const JAMS = ["regime=no_flow", "regime=inconsistent", "torn=true", "slid=true"];

export async function show(main, id) {
  const at = `/v1/sweeps/${id}`;
  let sweep = await read(at);
  const results = { points: [], trials: [], effects: [] };
  const head = h("div"), bar = h("div", { class: "row" }), trouble = h("div"), controls = h("div", { class: "row card" });
  const [response, map, effect, surface] = ["Response against factor", "Map over two factors", "Main effects", "Response surface"].map((title) => panel(title));
  const coordinates = parallel();
  const grouping = sweep.points > MOST_GROUPS ? sweep.factors[0] : "point";
  const curves = panel("Curves", { size: "tall-plot", controls: [
    choice("Series", SERIES, asked("series") ?? SERIES[0], (series) => (remember({ series }), drawCurves())),
    choice("Grouped by", [["point", "design point"], ...sweep.factors.map((pointer) => [pointer, factor(pointer, sweep.factors)])], asked("group") ?? grouping,
      (group) => (remember({ group }), drawCurves()))] });
  const points = pointsTable(), jobs = jobsTable(`${at}/jobs`);
  main.append(h("div", { class: "row spread" }, h("h1", {}, sweep.name), bar), head, trouble, controls, h("div", { class: "grid" }, response.card, map.card, effect.card, surface.card, curves.card), coordinates.card, points.card, jobs.card);

  const chosen = { response: asked("response"), word: asked("map"), x: asked("x"), y: asked("y") };
  const choose = (key) => (value) => {
    chosen[key] = value;
    remember({ response: chosen.response, map: chosen.word, x: chosen.x, y: chosen.y });
    draw();
  };

  function drawHead() {
    document.title = `${Math.floor(100 * sweep.fraction)} % ${sweep.name} · Roost`;
    const { queued, running, failed, cancelled } = sweep.counts;
    fillOnce(bar, `${queued + running > 0} ${failed + cancelled}`, () => actions(sweep, at, (now) => ((sweep = now), drawHead(), again(0))));
    fill(head, progress(sweep, true),
      h("div", { class: "row" }, state(stateOfSweep(sweep.counts)), h("span", {}, `${(100 * sweep.fraction).toFixed(1)} % of ${total(sweep.counts).toLocaleString("en")} jobs`),
        h("span", { class: "row counts" }, counts(sweep.counts)), pace.told(sweep)),
      facts([["Design", `${sweep.design.replaceAll("_", " ")}: ${sweep.points} points × ${sweep.replicates}`],
        ["Factors", sweep.factors.map((pointer) => factor(pointer, sweep.factors)).join(", ")],
        ["Submitted", moment(sweep.submitted_at)], ["Identifier", h("span", { class: "mono" }, sweep.id)]]));
  }

  function draw() {
    const all = measures(results.points), factors = sweep.factors;
    const named = (name) => all.find((one) => one.name === name);
    const measure = named(chosen.response) ?? preferred(all, FIRST);
    const mapped = named(chosen.word) ?? preferred(all, JAMS) ?? measure;
    const x = factors.includes(chosen.x) ? chosen.x : factors[0];
    const y = factors.includes(chosen.y) && chosen.y !== x ? chosen.y : factors.find((pointer) => pointer !== x);
    const options = all.map((one) => [one.name, one.label]), pointers = factors.map((pointer) => [pointer, factor(pointer, factors)]);
    if (!measure) {
      fill(controls, h("p", { class: "dim" }, "No results yet: plots come with the first job that succeeds."));
      return;
    }
    if (!controls.contains(document.activeElement)) {
      fill(controls, choice("Response", options, measure.name, choose("response")), choice("Map of", options, mapped.name, choose("word")),
        choice("Across", pointers, x, choose("x")), y && choice("By", pointers.filter(([pointer]) => pointer !== x), y, choose("y")));
    }
    const given = { ...results, factors, x };
    response.draw(() => responsePlot({ ...given, measure, by: y }));
    map.draw(() => (y ? mapPlot({ ...given, measure: mapped, y }) : null));
    effect.draw(() => effectsPlot({ effects: results.effects.find((one) => one.response === measure.name), factors, label: measure.label }));
    surface.draw(() => (y ? surfacePlot({ ...given, measure, y }) : null));
    coordinates.draw({ points: results.points, factors, measure });
    points.draw({ points: results.points, factors, all });
  }

  const fetched = new Map();
  async function drawCurves() {
    const name = asked("series") ?? SERIES[0];
    const done = results.trials.filter((trial) => trial.state === "succeeded").slice(0, MOST_CURVES);
    await each(done, async (trial) => {
      const key = `${trial.job_id} ${name}`;
      if (!fetched.has(key)) fetched.set(key, await read(`/v1/jobs/${trial.job_id}/series/${name}`).catch(() => null));
    });
    const by = asked("group") ?? grouping, groups = new Map();
    const group = grouped(by === "point" ? [] : done.map((trial) => trial.factors[by]), MOST_GROUPS, RANGES);
    const ofPoint = (trial) => ({ key: trial.point, title: sweep.factors.map((pointer) => group(trial.factors[pointer]).title).join(", ") });
    for (const trial of done) {
      const data = fetched.get(`${trial.job_id} ${name}`);
      if (!data) continue;
      const { key, title } = by === "point" ? ofPoint(trial) : group(trial.factors[by]);
      if (!groups.has(key)) groups.set(key, { key, name: by === "point" ? title : `${factor(by, sweep.factors)} ${title}`, replicates: [], unit: data.unit });
      groups.get(key).replicates.push(data);
    }
    const all = [...groups.values()].sort((a, b) => (typeof a.key === "number" ? a.key - b.key : String(a.key).localeCompare(String(b.key))));
    curves.draw(() => (all.length ? bandPlot(all, name, all[0].unit) : null));
  }

  let timer = null;
  const again = (wait = REST_MS) => (timer ??= setTimeout(load, wait));
  async function load() {
    timer = null;
    if (document.hidden) return again();
    if (sweep.points > MOST_POINTS) {
      fill(controls, h("p", { class: "dim" }, `${sweep.points.toLocaleString("en")} design points are too many to draw here: download the table.`));
      jobs.look();
      return;
    }
    try {
      const [byPoint, effects, byTrial] = await Promise.all([read(`${at}/results?by=point`), read(`${at}/effects`),
        total(sweep.counts) <= MOST_DOTS ? read(`${at}/results`) : { trials: [] }]);
      Object.assign(results, { points: byPoint.points, effects: effects.responses, trials: byTrial.trials });
      draw();
      jobs.look();
      await drawCurves();
    } catch (error) {
      fill(trouble, fault(error));
    }
  }

  const pace = paced();
  drawHead();
  load();
  follow(at, (now) => ((sweep = now), pace.seen(now), drawHead()), () => again(), (error) => fill(trouble, error ? fault(error) : []));
}

const SERIES = ["discharged_mass", "mass_rate", "bonds_intact_fraction", "kinetic_energy", "plate_force", "bend_angle", "sliding_speed", "lower_plate_force"];

/** How fast a sweep gets on, from what was seen in the last minutes, and how long it will take at that. */
function paced() {
  const seen = [];
  return {
    seen(sweep) {
      seen.push({ at: Date.now(), fraction: sweep.fraction });
      while (seen.length > 2 && Date.now() - seen[0].at > 300e3) seen.shift();
    },
    told(sweep) {
      const first = seen[0], last = seen.at(-1);
      const gained = first ? last.fraction - first.fraction : 0;
      if (gained <= 0 || last.at - first.at < 2000 || sweep.fraction >= 1) return null;
      const per_s = (1000 * gained) / (last.at - first.at);
      return h("span", { class: "dim" }, `${(3600 * per_s * total(sweep.counts)).toPrecision(3)} jobs an hour, ${duration((1 - sweep.fraction) / per_s)} left`);
    },
  };
}

/** What can be done to a sweep; `changed` gets it as it then is. */
function actions(sweep, at, changed) {
  const { queued, running, failed, cancelled } = sweep.counts;
  const download = h("details", { class: "menu" }, h("summary", {}, "Download"), ["csv", "json", "parquet"].map((format) =>
    h("a", { href: `${at}/results?format=${format}`, download: `${sweep.name}.${format}`, class: "row" }, format)));
  return [
    queued + running > 0 && action("Cancel", () => post(`${at}/cancel`).then(changed), { ask: `Cancel ${queued + running} jobs?` }),
    failed + cancelled > 0 && retry(failed + cancelled, (wanted) => post(`${at}/retry${wanted}`).then(changed)),
    extend(sweep, (more) => post(`${at}/extend`, more, crypto.randomUUID()).then(changed)),
    download,
  ];
}
