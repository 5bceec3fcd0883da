// Jobs side by side: their curves in one plot each, their responses in one table.

import { each, read } from "../api.js";
import { fill, h } from "../dom.js";
import { factor, number, short, titled } from "../format.js";
import { level } from "../measures.js";
import { units } from "../outputs.js";
import { MOST_COMPARED, asked, fault, state, table } from "../parts.js";
import { curveKey, curvesOf, linePlot } from "../plots/curves.js";
import { panel } from "../plots/plot.js";

const ID = /[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}/g;

export async function show(main) {
  document.title = "Compare · Roost";
  const ids = [...new Set((asked("jobs") ?? "").match(ID) ?? [])].slice(0, MOST_COMPARED);
  const input = h("input", { id: "jobs", name: "jobs", size: 60, value: ids.join(","), placeholder: "identifiers or links of jobs" });
  const form = h("form", { class: "row", onsubmit: (event) => {
    event.preventDefault();
    location.search = new URLSearchParams({ jobs: (input.value.match(ID) ?? []).join(",") });
  } }, h("label", { class: "field grow" }, "Jobs", input), h("button", { class: "main" }, "Compare"));
  const place = h("div");
  main.append(h("h1", {}, "Compare jobs"), form, place);
  if (ids.length === 0) {
    fill(place, h("p", { class: "dim" }, `Up to ${MOST_COMPARED} jobs: every job's page has a link to here.`));
    return;
  }
  try {
    draw(place, named(await each(ids, load)), await units());
  } catch (error) {
    fill(place, fault(error));
  }
}

async function load(id) {
  const job = await read(`/v1/jobs/${id}`);
  const result = await read(`/v1/jobs/${id}/result`).catch((error) => (error.status === 404 ? null : Promise.reject(error)));
  return { job, result };
}

/** Jobs with names: by the levels in which they differ, or by their identifiers. */
function named(all) {
  const pointers = [...new Set(all.flatMap(({ job }) => Object.keys(job.factors)))];
  const parts = [...pointers.map((pointer) => [factor(pointer, pointers), ({ job }) => level(job.factors[pointer])]), ["seed", ({ job }) => job.seed]];
  const differing = parts.filter(([, of]) => new Set(all.map(of)).size > 1);
  return all.map((one) => ({ ...one, name: differing.map(([title, of]) => `${title} ${number(of(one))}`).join(", ") || short(one.job.id) }));
}

/** Fields of two scenarios by pointer. */
function leaves(value, at = "", found = {}) {
  if (value !== null && typeof value === "object" && !Array.isArray(value)) for (const [key, inner] of Object.entries(value)) leaves(inner, `${at}/${key}`, found);
  else found[at] = JSON.stringify(value);
  return found;
}

/** Draws the jobs; `unit` has the units of responses by name. */
function draw(place, all, unit) {
  const columns = (first, cell) => [first, ...all.map((one, i) => ({ title: one.name, is_number: true, cell: (name) => cell(one, name, i) }))];
  const done = all.filter((one) => one.result);
  const responses = [...new Set(done.flatMap((one) => Object.keys(one.result.responses)))].sort();
  const scenarios = all.map((one) => (one.result ? leaves(one.result.scenario) : {}));
  const fields = [...new Set(scenarios.flatMap(Object.keys))].filter((pointer) => new Set(scenarios.map((one) => one[pointer])).size > 1);
  const told = (value) => (value === undefined ? "–" : typeof value === "string" ? value.replaceAll("_", " ") : number(value, 5));
  const kinds = [...new Set(done.flatMap((one) => curvesOf(one.result).map(curveKey)))];
  const cards = kinds.map((key) => {
    const lines = done.map((one) => ({ name: one.name, path: `/jobs/${one.job.id}`, data: curvesOf(one.result).find((data) => curveKey(data) === key) })).filter((line) => line.data);
    const one = panel(titled(lines[0].data.name, lines[0].data.unit));
    one.draw(() => linePlot(lines));
    return one.card;
  });
  fill(place,
    h("section", { class: "card wide" }, table("Jobs", [
      { title: "Job", cell: (one) => h("a", { href: `/jobs/${one.job.id}` }, one.name) }, { title: "State", cell: (one) => state(one.job.state) },
      { title: "Ended", cell: (one) => one.result?.end_reason.replaceAll("_", " ") ?? "–" }, { title: "Backend", cell: (one) => one.result?.solver.backend ?? "–" },
    ], all)),
    fields.length > 0 && h("section", { class: "card wide" }, table("Where the scenarios differ", columns({ title: "Field", cell: (pointer) => h("code", {}, pointer) }, (_, pointer, i) => scenarios[i][pointer] ?? "–"), fields)),
    h("div", { class: "grid" }, cards),
    responses.length > 0 && h("section", { class: "card wide" }, table("Responses", columns({ title: "Response", cell: (name) => titled(name, unit.get(name)) }, (one, name) => told(one.result?.responses[name])), responses)));
}
