// @ts-check
// Projects: their shares of the claims, budgets, core-hours and jobs.

import { poll } from "../api.js";
import { fill, h } from "../dom.js";
import { number } from "../format.js";
import { errorBox, table } from "../parts.js";

/**
 * The used part of the budget of a project; null without a budget.
 * @param {ProjectView} project
 */
function usedPart({ budget_core_hours: budget, used_core_hours: used }) {
  if (budget === null || budget === undefined) return null;
  return used >= budget ? 1 : used / budget;
}

/** @param {ProjectView} project */
function budget(project) {
  const used = usedPart(project);
  if (used === null) return "no limit";
  const percent = Math.floor(100 * used);
  return [
    h("div", { class: "bar", role: "progressbar", "aria-valuemin": 0, "aria-valuemax": 100, "aria-valuenow": percent,
      "aria-label": `${project.name}: ${percent} % of the budget used` },
      h("span", { class: used < 1 ? "running" : "failed", style: { "--part": `${100 * used}%` } })),
    `${percent} % of ${number(project.budget_core_hours)}`,
  ];
}

/** @type {Column<ProjectView>[]} */
const COLUMNS = [
  { title: "Project", is_text: true, cell: (project) => h("strong", {}, project.name) },
  { title: "Share", is_number: true, cell: (project) => project.share.toLocaleString("en") },
  { title: "Queued jobs", is_number: true, cell: (project) => project.queued.toLocaleString("en") },
  { title: "Running jobs", is_number: true, cell: (project) => project.running.toLocaleString("en") },
  { title: "Core-hours used", is_number: true, cell: (project) => number(project.used_core_hours) },
  { title: "Budget in core-hours", is_text: true, cell: budget },
  { title: "", is_text: true, cell: (project) => usedPart(project) === 1 && h("span", { class: "state failed" }, "budget used up: its queued jobs wait") },
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
