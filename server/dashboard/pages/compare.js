// @ts-check
// Comparison of jobs: a plot for each series, a table of responses, and the fields in which the scenarios differ.

import { mapConcurrently, read, readIfThere } from "../api.js";
import { fill, h } from "../dom.js";
import { factorLabel, number, shortId, labelOf } from "../format.js";
import { level } from "../measures.js";
import { isPerBody, readOutputs } from "../outputs.js";
import { MAX_COMPARED, errorBox, parameter, responseLabel, state, table } from "../parts.js";
import { curveKey, curvesOf, linePlot } from "../plots/curves.js";
import { panel } from "../plots/plot.js";

const ID = /[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}/g;

/** @typedef {{ job: JobView, result: RunResult | null }} Loaded */
/** @typedef {Loaded & { name: string }} Named */

/** @param {HTMLElement} main */
export async function show(main) {
  document.title = "Compare · Roost";
  const ids = [...new Set((parameter("jobs") ?? "").match(ID) ?? [])].slice(0, MAX_COMPARED);
  const input = h("input", { id: "jobs", name: "jobs", size: 60, value: ids.join(","), placeholder: "identifiers or links of jobs" });
  const form = h("form", { class: "row", onsubmit: (/** @type {Event} */ event) => {
    event.preventDefault();
    location.search = new URLSearchParams({ jobs: (input.value.match(ID) ?? []).join(",") }).toString();
  } }, h("label", { class: "field grow" }, "Jobs", input), h("button", { class: "main" }, "Compare"));
  const place = h("div");
  main.append(h("h1", {}, "Compare jobs"), form, place);
  if (ids.length === 0) {
    fill(place, h("p", { class: "dim" }, `Enter up to ${MAX_COMPARED} jobs, or follow the link “compare” on the page of a job.`));
    return;
  }
  try {
    const [loaded, outputs] = await Promise.all([mapConcurrently(ids, load), readOutputs()]);
    draw(place, withNames(loaded), outputs);
  } catch (error) {
    fill(place, errorBox(/** @type {Error} */ (error)));
  }
}

/** @param {string} id @returns {Promise<Loaded>} */
async function load(id) {
  return { job: await read(`/v1/jobs/${id}`), result: await readIfThere(`/v1/jobs/${id}/result`) };
}

/**
 * Names jobs by the levels in which they differ, or by their identifiers.
 * @param {Loaded[]} all @returns {Named[]}
 */
function withNames(all) {
  const pointers = [...new Set(all.flatMap(({ job }) => Object.keys(job.factors)))];
  /** @type {[string, (one: Loaded) => Level][]} */
  const parts = [...pointers.map((pointer) => /** @type {[string, (one: Loaded) => Level]} */ ([factorLabel(pointer, pointers), ({ job }) => level(job.factors[pointer])])), ["seed", ({ job }) => job.seed]];
  const differing = parts.filter(([, of]) => new Set(all.map(of)).size > 1);
  return all.map((one) => ({ ...one, name: differing.map(([title, of]) => `${title} ${number(of(one))}`).join(", ") || shortId(one.job.id) }));
}

/**
 * The fields of a scenario by pointer, as JSON.
 * @param {unknown} value @param {string} at @param {Record<string, string>} found
 */
function leaves(value, at = "", found = {}) {
  if (value !== null && typeof value === "object" && !Array.isArray(value)) for (const [key, inner] of Object.entries(value)) leaves(inner, `${at}/${key}`, found);
  else found[at] = JSON.stringify(value);
  return found;
}

/** @param {HTMLElement} place @param {Named[]} all @param {OutputTable} outputs */
function draw(place, all, outputs) {
  /**
   * @param {Column<string>} first @param {(i: number, name: string) => Child} cell
   * @returns {Column<string>[]}
   */
  const columns = (first, cell) => [first, ...all.map((one, i) => ({ title: one.name, is_number: true, cell: (/** @type {string} */ name) => cell(i, name) }))];
  const done = all.flatMap(({ result, ...one }) => (result ? [{ ...one, result }] : []));
  const responses = [...new Set(done.flatMap((one) => Object.keys(one.result.responses)))].sort();
  const scenarios = all.map((one) => (one.result ? leaves(one.result.scenario) : {}));
  const fields = [...new Set(scenarios.flatMap(Object.keys))].filter((pointer) => new Set(scenarios.map((one) => one[pointer])).size > 1);
  const text = (/** @type {unknown} */ value) => (value === undefined ? "–" : typeof value === "string" ? value.replaceAll("_", " ") : number(value, 5));
  const keys = [...new Set(done.flatMap((one) => curvesOf(one.result).map(curveKey)))];
  const cards = keys.map((key) => {
    const lines = done.flatMap((one) => {
      const data = curvesOf(one.result).find((data) => curveKey(data) === key);
      return data ? [{ name: one.name, path: `/jobs/${one.job.id}`, data }] : [];
    });
    const plot = panel(labelOf(lines[0].data.name, lines[0].data.unit));
    plot.draw(() => linePlot(lines, isPerBody(outputs, lines[0].data)));
    return plot.card;
  });
  fill(place,
    h("section", { class: "card wide" }, table("Jobs", [
      { title: "Job", cell: (one) => h("a", { href: `/jobs/${one.job.id}` }, one.name) }, { title: "State", cell: (one) => state(one.job.state) },
      { title: "End reason", cell: (one) => one.result?.end_reason.replaceAll("_", " ") ?? "–" }, { title: "Backend", cell: (one) => one.result?.solver.backend ?? "–" },
    ], all)),
    fields.length > 0 && h("section", { class: "card wide" }, table("Differences between the scenarios", columns({ title: "Field", cell: (pointer) => h("code", {}, pointer) }, (i, pointer) => scenarios[i][pointer] ?? "–"), fields)),
    h("div", { class: "grid" }, cards),
    responses.length > 0 && h("section", { class: "card wide" }, table("Responses", columns({ title: "Response", cell: (name) => responseLabel(outputs, name) }, (i, name) => text(all[i].result?.responses[name])), responses)));
}
