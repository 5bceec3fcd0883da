// @ts-check
// The two tables of a sweep: responses by design point, and jobs page by page.

import { poll } from "../api.js";
import { fill, h } from "../dom.js";
import { factorLabel, plural, number, shortId } from "../format.js";
import { level } from "../measures.js";
import { FAILURE_CLASSES, STATES, parameter, choice, errorBox, pager, requested, since, sortRows, setParameters, state, table } from "../parts.js";

/** Rows that are drawn. */
const ROWS = 200;
/** @typedef {{ points: PointRow[], factors: string[], all: Measure[], headline: string[], path: (row: PointRow) => string | null }} PointsInput */

/** Design points, which any column can sort. */
export function pointsTable() {
  const place = h("div", { class: "wide tall" }), show_all_label = h("label", { class: "field" });
  const card = h("section", { class: "card", hidden: true }, h("div", { class: "row spread" }, h("h2", {}, "Design points"), show_all_label), place);
  const chosen = parameter("sort");
  /** @type {Sort | null} */
  let sort = chosen ? { by: Number(chosen.replace("-", "")), down: chosen.startsWith("-") } : null;
  /** @type {PointsInput} */
  let input = { points: [], factors: [], all: [], headline: [], path: () => null };
  const show_all = h("input", { type: "checkbox", onchange: () => render() });
  show_all_label.append(show_all, "all responses");
  function render() {
    const { points, factors, all, headline, path } = input;
    const shown = show_all.checked ? all : all.filter((one) => headline.includes(one.name.split("=")[0]));
    /** @returns {Column<PointRow>} */
    const mean = (/** @type {Measure} */ measure) => ({
      title: measure.label, is_number: true, value: (row) => measure.of(row)?.mean,
      cell: (row) => {
        const value = measure.of(row);
        if (!value) return "–";
        return h("span", { title: `95 %: ${number(value.low)} to ${number(value.high)}` }, measure.is_share ? `${value.count} of ${value.n}` : number(value.mean));
      },
    });
    /** @type {Column<PointRow>[]} */
    const columns = [
      { title: "Point", is_number: true, value: (row) => row.point, cell: (row) => h("a", { href: path(row), title: "jobs of this point" }, row.point) },
      ...factors.map((pointer) => /** @type {Column<PointRow>} */ ({ title: factorLabel(pointer, factors), is_number: true, value: (row) => level(row.factors[pointer]), cell: (row) => number(level(row.factors[pointer])) })),
      { title: "Trials", is_number: true, value: (row) => row.counts.succeeded, cell: (row) => `${row.counts.succeeded}/${STATES.reduce((n, state) => n + row.counts[state], 0)}` },
      { title: "Unstable", is_number: true, value: (row) => row.unstable, cell: (row) => row.unstable || "" },
      ...shown.map(mean),
    ];
    const sorted = (/** @type {Sort} */ to) => {
      sort = to;
      setParameters({ sort: `${to.down ? "-" : ""}${to.by}` });
      render();
    };
    const rows = sortRows(points, columns, sort);
    const scroll = [place.scrollLeft, place.scrollTop];
    fill(place, table(`${plural(points.length, "point")}${rows.length > ROWS ? `, the first ${ROWS} in this order` : ""}; means over trials`, columns, rows.slice(0, ROWS), { sort, sorted }));
    [place.scrollLeft, place.scrollTop] = scroll;
  }
  return { card, draw: (/** @type {PointsInput} */ next) => {
    input = next;
    card.hidden = false;
    render();
  } };
}

/** Filters of the listing of jobs, named alike in the page's address and in the query. */
const FILTERS = ["state", "failure", "point"];

/**
 * The jobs of a listing, page by page, filtered by state, failure class and design point.
 * @param {string} path
 */
export function jobsTable(path) {
  const place = h("div", { class: "wide tall" }), buttons = h("div"), errors = h("div");
  /** @type {(string | null)[]} */
  let cursors = [null];
  let stop = () => {};
  const filter = (/** @type {string} */ name) => (/** @type {string} */ value) => {
    setParameters({ [name]: value });
    show([null]);
  };
  const point = h("input", { type: "number", min: 0, style: { width: "90px" }, value: parameter("point") ?? "", onchange: () => void filter("point")(point.value) });
  const card = h("section", { class: "card", id: "jobs" }, h("div", { class: "row spread" }, h("h2", {}, "Jobs"), h("div", { class: "row" },
    choice("State", [["", "all"], ...STATES], parameter("state") ?? "", filter("state")), choice("Failure class", [["", "any"], ...FAILURE_CLASSES], parameter("failure") ?? "", filter("failure")),
    h("label", { class: "field" }, "Point", point))), errors, place, buttons);
  /** @type {Column<JobView>[]} */
  const columns = [
    { title: "Job", cell: (job) => h("a", { href: `/jobs/${job.id}`, class: "mono" }, shortId(job.id)) },
    { title: "State", cell: (job) => state(job.state, requested(job) ?? (job.failure_class ?? (job.from_cache ? "cached result" : undefined))) },
    { title: "Point", is_number: true, cell: (job) => job.point ?? "–" },
    { title: "Seed", is_number: true, cell: (job) => job.seed },
    { title: "Levels", is_text: true, cell: (job) => Object.entries(job.factors).map(([pointer, value]) => `${factorLabel(pointer, Object.keys(job.factors))} ${number(level(value))}`).join(", ") },
    { title: "Progress", is_number: true, cell: (job) => (job.progress ? `${Math.floor(100 * job.progress.fraction)} %` : "") },
    { title: "Attempt", is_number: true, cell: (job) => job.attempt || "" },
    { title: "Ended", cell: (job) => (job.ended_at ? since(job.ended_at) : "") },
    { title: "Failure", is_text: true, cell: (job) => job.failure_message ?? "" },
  ];
  /** @param {(string | null)[]} to cursors up to the page */
  function show(to) {
    cursors = to;
    stop();
    const query = new URLSearchParams({ limit: "100" }), cursor = cursors.at(-1);
    for (const name of FILTERS) {
      const value = parameter(name);
      if (value) query.set(name, value);
    }
    if (cursor) query.set("cursor", cursor);
    stop = poll(`${path}?${query}`, 5, draw, (error) => fill(errors, error ? errorBox(error) : []));
  }
  /** @param {Page<JobView>} page */
  function draw(page) {
    fill(place, table(`${plural(page.items.length, "job")}, newest first, from number ${1 + 100 * (cursors.length - 1)}`, columns, page.items));
    fill(buttons, pager(cursors, page.next_cursor, show, "jobs-"));
  }
  show(cursors);
  return card;
}
