// The two tables of a sweep: design points with what came out, and jobs page by page.

import { poll } from "../api.js";
import { fill, h } from "../dom.js";
import { ago, factor, many, number, short } from "../format.js";
import { level } from "../measures.js";
import { CLASSES, STATES, asked, choice, fault, inOrder, remember, state, table } from "../parts.js";

/** Rows that are drawn at once. */
const ROWS = 200;
/** Design points, sorted by any column. */
export function pointsTable() {
  const place = h("div", { class: "wide tall" }), more = h("label", { class: "field" });
  const card = h("section", { class: "card", hidden: true }, h("div", { class: "row spread" }, h("h2", {}, "Design points"), more), place);
  let sort = asked("sort") ? { by: Number(asked("sort").replace("-", "")), down: asked("sort").startsWith("-") } : null, is_all = false, given = null;
  const every = h("input", { type: "checkbox", onchange: () => ((is_all = every.checked), render()) });
  more.append(every, "every response");
  function render() {
    const { points, factors, all, first, path } = given;
    const shown = is_all ? all : all.filter((one) => first.includes(one.name.split("=")[0]));
    const mean = (measure) => ({
      title: measure.label, is_number: true, value: (row) => measure.of(row)?.mean,
      cell: (row) => {
        const value = measure.of(row);
        if (!value) return "–";
        return measure.is_share ? `${value.count} of ${value.n}` : h("span", { title: `95 %: ${number(value.low)} to ${number(value.high)}` }, number(value.mean));
      },
    });
    const columns = [
      { title: "Point", is_number: true, value: (row) => row.point, cell: (row) => h("a", { href: path(row), title: "its jobs" }, row.point) },
      ...factors.map((pointer) => ({ title: factor(pointer, factors), is_number: true, value: (row) => level(row.factors[pointer]), cell: (row) => number(level(row.factors[pointer])) })),
      { title: "Trials", is_number: true, value: (row) => row.counts.succeeded, cell: (row) => `${row.counts.succeeded}/${STATES.reduce((n, state) => n + row.counts[state], 0)}` },
      { title: "Unstable", is_number: true, value: (row) => row.unstable, cell: (row) => row.unstable || "" },
      ...shown.map(mean),
    ];
    const sorted = (to) => ((sort = to), remember({ sort: `${to.down ? "-" : ""}${to.by}` }), render());
    const rows = inOrder(points, columns, sort);
    const scroll = [place.scrollLeft, place.scrollTop];
    fill(place, table(`${many(points.length, "point")}${rows.length > ROWS ? `, the first ${ROWS} in this order` : ""}; means over trials`, columns, rows.slice(0, ROWS), { sort, sorted }));
    [place.scrollLeft, place.scrollTop] = scroll;
  }
  return { card, draw: (what) => ((given = what), (card.hidden = false), render()) };
}

/** What a listing of jobs can be filtered by; they stand in the address under the same names. */
const FILTERS = ["state", "failure", "point"];

/** Jobs of a listing, page by page, by state, class of failure and design point. */
export function jobsTable(path) {
  const place = h("div", { class: "wide tall" }), turns = h("div", { class: "row" }), trouble = h("div");
  let cursors = [null], end = () => {};
  const filter = (name) => (value) => (remember({ [name]: value }), (cursors = [null]), look());
  const point = h("input", { type: "number", min: 0, style: { width: "90px" }, value: asked("point") ?? "", onchange: () => filter("point")(point.value) });
  const card = h("section", { class: "card", id: "jobs" }, h("div", { class: "row spread" }, h("h2", {}, "Jobs"), h("div", { class: "row" },
    choice("State", [["", "all"], ...STATES], asked("state") ?? "", filter("state")), choice("Failed as", [["", "any"], ...CLASSES], asked("failure") ?? "", filter("failure")),
    h("label", { class: "field" }, "Point", point))), trouble, place, turns);
  const columns = [
    { title: "Job", cell: (job) => h("a", { href: `/jobs/${job.id}`, class: "mono" }, short(job.id)) },
    { title: "State", cell: (job) => state(job.state, job.cancelling ? "cancelling" : (job.failure_class ?? (job.from_cache ? "from the store" : undefined))) },
    { title: "Point", is_number: true, cell: (job) => job.point ?? "–" },
    { title: "Seed", is_number: true, cell: (job) => job.seed },
    { title: "Levels", is_text: true, cell: (job) => Object.entries(job.factors).map(([pointer, value]) => `${factor(pointer, Object.keys(job.factors))} ${number(level(value))}`).join(", ") },
    { title: "Progress", is_number: true, cell: (job) => (job.progress ? `${Math.floor(100 * job.progress.fraction)} %` : "") },
    { title: "Attempt", is_number: true, cell: (job) => job.attempt || "" },
    { title: "Ended", cell: (job) => (job.ended_at ? ago(job.ended_at) : "") },
    { title: "What failed", is_text: true, cell: (job) => job.failure_message ?? "" },
  ];
  const turn = (to) => ((cursors = to), look());
  function look() {
    end();
    const query = new URLSearchParams({ limit: 100 });
    for (const name of FILTERS) if (asked(name)) query.set(name, asked(name));
    if (cursors.at(-1)) query.set("cursor", cursors.at(-1));
    end = poll(`${path}?${query}`, 5, draw, (error) => fill(trouble, error ? fault(error) : []));
  }
  function draw(page) {
    fill(place, table(`${many(page.items.length, "job")}, newest first, from number ${1 + 100 * (cursors.length - 1)}`, columns, page.items));
    fill(turns, h("button", { id: "jobs-newer", disabled: cursors.length === 1, onclick: () => turn(cursors.slice(0, -1)) }, "Newer"),
      h("button", { id: "jobs-older", disabled: !page.next_cursor, onclick: () => turn([...cursors, page.next_cursor]) }, "Older"));
  }
  look();
  return card;
}
