// @ts-check
// All studies, newest first, with state, question and runs.

import { poll } from "../api.js";
import { fill, h, withCode } from "../dom.js";
import { errorBox, pager, since, table } from "../parts.js";
import { runsBar, stateOfStudy } from "../sections/study.js";

/** @type {Column<StudyView>[]} */
const COLUMNS = [
  { title: "Study", is_text: true, cell: (study) => h("a", { href: `/studies/${study.id}` }, study.name) },
  { title: "State", cell: stateOfStudy },
  { title: "Question", is_text: true, cell: (study) => withCode(study.question) },
  { title: "Runs", cell: (study) => runsBar(study) },
  { title: "Done", is_number: true, cell: (study) => `${study.runs.done.toLocaleString("en")} of ${study.runs.max_runs.toLocaleString("en")}` },
  { title: "Failed", is_number: true, cell: (study) => study.runs.failed.toLocaleString("en") },
  { title: "Submitted", cell: (study) => since(study.submitted_at) },
];

/** @param {HTMLElement} main */
export function show(main) {
  document.title = "Studies · Roost";
  const rows = h("div", { class: "wide" }), errors = h("div");
  main.append(h("h1", {}, "Studies"), h("p", { class: "dim" }, "A study is a question about a scenario. The server proposes runs until the answer is as certain as asked."),
    errors, h("section", { class: "card" }, rows));
  let stop = () => {};
  const list = (/** @type {(string | null)[]} cursors up to the page */ cursors) => {
    stop();
    const query = new URLSearchParams({ limit: "50" }), cursor = cursors.at(-1);
    if (cursor) query.set("cursor", cursor);
    const draw = (/** @type {Page<StudyView>} */ page) => {
      if (page.items.length === 0 && cursors.length === 1) fill(rows, h("p", {}, "No studies yet. To submit one, post it to ", h("code", {}, "/v1/studies"), "."));
      else fill(rows, table(`${page.items.length === 1 ? "1 study" : `${page.items.length} studies`}, newest first`, COLUMNS, page.items), pager(cursors, page.next_cursor, list));
    };
    stop = poll(`/v1/studies?${query}`, 2, draw, (error) => fill(errors, error ? errorBox(error) : []));
  };
  list([null]);
}
