// @ts-check
// Projects: their shares of the claims, budgets, core-hours and jobs.

import { poll } from "../api.js";
import { fill, h } from "../dom.js";
import { number } from "../format.js";
import { bar, errorBox, table } from "../parts.js";

/** @param {ProjectView} project */
const hasBudget = ({ budget_core_hours }) => typeof budget_core_hours === "number";

/** @param {ProjectView} project */
const isUsedUp = ({ budget_core_hours, used_core_hours }) => typeof budget_core_hours === "number" && used_core_hours >= budget_core_hours;

/** @param {ProjectView} project @returns {Child} */
function budget(project) {
  if (!hasBudget(project)) return "no limit";
  const limit = project.budget_core_hours ?? 0;
  // Attempts that run when the budget is used up may exceed it.
  const percent = limit > 0 ? Math.floor((100 * project.used_core_hours) / limit) : 100;
  const shown = Math.min(100, percent);
  return [
    bar(`budget of ${project.name}`, shown, [[isUsedUp(project) ? "failed" : "running", shown / 100]]),
    limit > 0 ? `${percent.toLocaleString("en")} % of ${number(limit)}` : "0",
  ];
}

/** @param {ProjectView} project */
function state(project) {
  if (!isUsedUp(project)) return "";
  return h("span", { class: "state failed" }, project.queued > 0 ? "budget used up: its queued jobs wait" : "budget used up");
}

/** @type {Column<ProjectView>[]} */
const COLUMNS = [
  { title: "Project", is_text: true, cell: (project) => h("strong", {}, project.name) },
  { title: "Share", is_number: true, cell: (project) => project.share.toLocaleString("en") },
  { title: "Queued jobs", is_number: true, cell: (project) => project.queued.toLocaleString("en") },
  { title: "Running jobs", is_number: true, cell: (project) => project.running.toLocaleString("en") },
  { title: "Core-hours used", is_number: true, cell: (project) => number(project.used_core_hours) },
  { title: "Budget in core-hours", is_text: true, cell: budget },
  { title: "State", is_text: true, cell: state },
];

/** @param {HTMLElement} main */
export function show(main) {
  document.title = "Projects · Roost";
  const [projects, errors] = [h("section", { class: "card wide" }), h("div")];
  main.append(h("h1", {}, "Projects"), errors, projects,
    h("p", {}, "While several projects have queued jobs, the workers take jobs of each project in proportion to its share. The operator sets shares and budgets on the server, for example by ",
      h("code", {}, "roost project set NAME --share 2 --budget-core-hours 500"), "."));
  poll("/v1/projects?limit=500", 5, (/** @type {Page<ProjectView>} */ page) =>
    fill(projects, table("Jobs and core-hours of each project", COLUMNS, page.items)),
    (error) => fill(errors, error ? errorBox(error) : []), { is_whole: true });
}
