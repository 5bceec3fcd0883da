// All sweeps, newest first: is it running, how far, what failed.

import { poll } from "../api.js";
import { fill, h } from "../dom.js";
import { ago, factor, many } from "../format.js";
import { asked, counts, failures, fault, progress, remember, state, stateOfSweep, table, total } from "../parts.js";

const COLUMNS = [
  { title: "Sweep", is_text: true, cell: (sweep) => h("a", { href: `/sweeps/${sweep.id}` }, sweep.name) },
  { title: "State", cell: (sweep) => state(stateOfSweep(sweep.counts)) },
  { title: "Progress", cell: (sweep) => progress(sweep) },
  { title: "Done", is_number: true, cell: (sweep) => `${Math.floor(100 * sweep.fraction)} %` },
  { title: "Jobs", cell: (sweep) => h("span", { class: "row counts" }, counts(sweep.counts), failures(sweep, `/sweeps/${sweep.id}`)) },
  { title: "All", is_number: true, cell: (sweep) => total(sweep.counts).toLocaleString("en") },
  { title: "Design", cell: (sweep) => `${sweep.design.replaceAll("_", " ")}, ${sweep.points.toLocaleString("en")} × ${sweep.replicates}` },
  { title: "Factors", is_text: true, cell: (sweep) => sweep.factors.map((pointer) => factor(pointer, sweep.factors)).join(", ") },
  { title: "Submitted", cell: (sweep) => h("time", { datetime: sweep.submitted_at }, ago(sweep.submitted_at)) },
];

export function show(main) {
  document.title = "Sweeps · Roost";
  const list = h("div", { class: "wide" });
  const trouble = h("div");
  const label = h("input", { id: "label", type: "search", placeholder: "key or key=value", value: asked("label") ?? "", onchange: () => look() });
  main.append(
    h("div", { class: "row spread" }, h("h1", {}, "Sweeps"),
      h("div", { class: "row" }, h("label", { class: "field" }, "Label", label), h("a", { href: "/submit" }, "Submit a sweep"))),
    trouble, h("section", { class: "card" }, list));
  let cursors = [null], end = () => {};
  const turn = (to) => ((cursors = to), look(true));
  const look = (is_turn = false) => {
    end();
    if (!is_turn) cursors = [null];
    remember({ label: label.value });
    const query = new URLSearchParams({ limit: 50 });
    if (label.value) query.set("label", label.value);
    if (cursors.at(-1)) query.set("cursor", cursors.at(-1));
    end = poll(`/v1/sweeps?${query}`, 2, draw, (error) => fill(trouble, error ? fault(error) : []));
  };
  const draw = (page) => {
    if (page.items.length === 0 && cursors.length === 1) {
      fill(list, h("p", {}, "No sweeps yet. ", h("a", { href: "/submit" }, "Submit one"), ", or ", h("code", {}, "roost submit sweep.json"), "."));
      return;
    }
    fill(list, table(`${many(page.items.length, "sweep")}, newest first`, COLUMNS, page.items),
      h("div", { class: "row" },
        h("button", { id: "newer", disabled: cursors.length === 1, onclick: () => turn(cursors.slice(0, -1)) }, "Newer"),
        h("button", { id: "older", disabled: !page.next_cursor, onclick: () => turn([...cursors, page.next_cursor]) }, "Older")));
  };
  look();
}
