// @ts-check
// All sweeps, newest first, with state, progress and failures.

import { poll } from "../api.js";
import { fill, h } from "../dom.js";
import { factorLabel, plural } from "../format.js";
import { parameter, counts, failures, errorBox, pager, progress, setParameters, since, state, stateOfSweep, table, total } from "../parts.js";

/** @type {Column<SweepView>[]} */
const COLUMNS = [
  { title: "Sweep", is_text: true, cell: (sweep) => h("a", { href: `/sweeps/${sweep.id}` }, sweep.name) },
  { title: "State", cell: (sweep) => state(stateOfSweep(sweep.counts)) },
  { title: "Progress", cell: (sweep) => progress(sweep) },
  { title: "Done", is_number: true, cell: (sweep) => `${Math.floor(100 * sweep.fraction)} %` },
  { title: "Jobs", cell: (sweep) => h("span", { class: "row counts" }, counts(sweep.counts), failures(sweep, `/sweeps/${sweep.id}`)) },
  { title: "Total", is_number: true, cell: (sweep) => total(sweep.counts).toLocaleString("en") },
  { title: "Design", cell: (sweep) => `${sweep.design.replaceAll("_", " ")}, ${sweep.points.toLocaleString("en")} × ${sweep.replicates}` },
  { title: "Factors", is_text: true, cell: (sweep) => sweep.factors.map((pointer) => factorLabel(pointer, sweep.factors)).join(", ") },
  { title: "Submitted", cell: (sweep) => since(sweep.submitted_at) },
];

/** @param {HTMLElement} main */
export function show(main) {
  document.title = "Sweeps · Roost";
  const rows = h("div", { class: "wide" }), errors = h("div");
  const label = h("input", { id: "label", type: "search", placeholder: "key or key=value", value: parameter("label") ?? "", onchange: () => void list([null]) });
  main.append(
    h("div", { class: "row spread" }, h("h1", {}, "Sweeps"),
      h("div", { class: "row" }, h("label", { class: "field" }, "Label", label), h("a", { href: "/submit" }, "Submit a sweep"))),
    errors, h("section", { class: "card" }, rows));
  /** @type {(string | null)[]} */
  let cursors = [null];
  let stop = () => {};
  const list = (/** @type {(string | null)[]} cursors up to the page */ to) => {
    cursors = to;
    stop();
    setParameters({ label: label.value });
    const query = new URLSearchParams({ limit: "50" }), cursor = cursors.at(-1);
    if (label.value) query.set("label", label.value);
    if (cursor) query.set("cursor", cursor);
    stop = poll(`/v1/sweeps?${query}`, 2, draw, (error) => fill(errors, error ? errorBox(error) : []));
  };
  const draw = (/** @type {Page<SweepView>} */ page) => {
    if (page.items.length === 0 && cursors.length === 1) {
      fill(rows, label.value ? h("p", {}, "No sweep has this label.") : h("p", {}, "No sweeps yet. ", h("a", { href: "/submit" }, "Submit a sweep"), " here, or run ", h("code", {}, "roost submit sweep.json"), "."));
      return;
    }
    fill(rows, table(`${plural(page.items.length, "sweep")}, newest first`, COLUMNS, page.items), pager(cursors, page.next_cursor, list));
  };
  list(cursors);
}
