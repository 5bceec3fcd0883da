// @ts-check
// Elements that several pages share: states, progress bars, tables, errors, and the choices in a page's address.

import { announce, h } from "./dom.js";
import { ago, labelOf } from "./format.js";
import { responseRow } from "./outputs.js";

/** @type {JobState[]} */
export const STATES = ["queued", "running", "succeeded", "failed", "cancelled"];
/** @type {FailureClass[]} */
export const FAILURE_CLASSES = ["invalid", "unstable", "worker", "lost", "timeout"];
/** @type {JobState[]} */
const ENDED = ["succeeded", "failed", "cancelled"];

/**
 * Whether a job in this state has ended.
 * @param {JobState} state
 */
export const isEnded = (state) => ENDED.includes(state);

/**
 * A state as a coloured dot and its word.
 * @param {JobState} word @param {string} [note]
 */
export function state(word, note) {
  return h("span", { class: `state ${word}` }, note ? `${word}: ${note}` : word);
}

/**
 * The note on the state of a job that somebody cancels or pauses.
 * @param {JobView} job
 */
export function requested(job) {
  if (job.cancelling) return "cancelling";
  return job.paused ? (job.state === "running" ? "pausing" : "paused") : undefined;
}

/**
 * The state of a sweep, which follows from its counts.
 * @param {StateCounts} counts @returns {JobState}
 */
export function stateOfSweep(counts) {
  if (counts.running > 0) return "running";
  if (counts.queued > 0) return "queued";
  if (counts.failed > 0) return "failed";
  return counts.cancelled > 0 ? "cancelled" : "succeeded";
}

/** @param {StateCounts} counts */
export const total = (counts) => STATES.reduce((sum, state) => sum + counts[state], 0);

/**
 * A progress bar of coloured parts. The label is for screen readers.
 * @param {string} label @param {number} percent @param {[colour: string, share: number][]} parts
 */
export function bar(label, percent, parts, is_large = false) {
  return h("div", { class: is_large ? "bar large" : "bar", role: "progressbar", "aria-valuemin": 0, "aria-valuemax": 100, "aria-valuenow": percent, "aria-label": label },
    parts.filter(([, share]) => share > 0).map(([colour, share]) => h("span", { class: colour, style: { "--part": `${100 * share}%` } })));
}

/**
 * The progress bar of a sweep: a part for each way in which jobs ended, and one for the work of running jobs.
 * @param {SweepView} sweep
 */
export function progress(sweep, is_large = false) {
  const all = Math.max(1, total(sweep.counts));
  /** @type {[JobState, number][]} */
  const ended = ENDED.map((state) => [state, sweep.counts[state] / all]);
  const running = Math.max(0, sweep.fraction - ended.reduce((sum, [, share]) => sum + share, 0));
  const percent = Math.floor(100 * sweep.fraction);
  return bar(`${sweep.name}: ${percent} % done`, percent, [...ended, ["running", running]], is_large);
}

/**
 * The counts that are not zero, by state.
 * @param {StateCounts} of
 */
export function counts(of) {
  return STATES.filter((word) => of[word] > 0).map((word) => state(word, of[word].toLocaleString("en")));
}

/**
 * The number of failed jobs of each class, as links to these jobs.
 * @param {SweepView} sweep @param {string} path
 */
export function failures(sweep, path) {
  const classes = Object.entries(sweep.failures ?? {}).filter(([, count]) => count > 0);
  return classes.length > 0 && h("span", { class: "row counts" }, classes.map(([name, count]) =>
    h("a", { href: `${path}?state=failed&failure=${name}#jobs`, class: "failure" }, `${count.toLocaleString("en")} ${name}`)));
}

/**
 * A table. With `sort` and `sorted`, the headings of columns that have a `value` are buttons.
 * @template Row
 * @param {string} caption @param {Column<Row>[]} columns @param {Row[]} rows @param {{ sort?: Sort | null, sorted?: (sort: Sort) => unknown }} [options]
 */
export function table(caption, columns, rows, { sort, sorted } = {}) {
  const alignment = (/** @type {Column<Row>} */ column) => (column.is_number ? "number" : column.is_text ? "text" : undefined);
  const heading = (/** @type {Column<Row>} */ column, /** @type {number} */ i) => {
    if (!sorted || !column.value) return h("th", { scope: "col", class: alignment(column) }, column.title);
    const is_sorted = sort?.by === i, is_down = is_sorted && sort.down;
    const order = is_sorted ? (is_down ? "descending" : "ascending") : undefined;
    const arrow = is_sorted ? (is_down ? " ▾" : " ▴") : "";
    return h("th", { scope: "col", class: alignment(column), "aria-sort": order },
      h("button", { id: `sort-${i}-${caption.length}`, onclick: () => sorted({ by: i, down: is_sorted && !is_down }) }, column.title + arrow));
  };
  return h("table", {}, h("caption", {}, caption),
    h("thead", {}, h("tr", {}, columns.map(heading))),
    h("tbody", {}, rows.map((row) => h("tr", {}, columns.map((column) => h("td", { class: alignment(column) }, column.cell(row)))))));
}

/**
 * Rows in the order of a column. Rows without a value come last in both directions.
 * @template Row
 * @param {Row[]} rows @param {Column<Row>[]} columns @param {Sort | null} sort
 */
export function sortRows(rows, columns, sort) {
  const value = sort && columns[sort.by]?.value;
  if (!value) return rows;
  const sign = sort.down ? -1 : 1;
  return [...rows].sort((a, b) => {
    const [left, right] = [value(a), value(b)];
    if (left === null || left === undefined) return 1;
    if (right === null || right === undefined) return -1;
    return sign * (typeof left === "number" && typeof right === "number" ? left - right : String(left).localeCompare(String(right)));
  });
}

/**
 * Buttons to the pages of a listing. `cursors` lead to the page that is shown; `show` gets those of another one.
 * @param {(string | null)[]} cursors @param {string | null | undefined} next @param {(cursors: (string | null)[]) => unknown} show @param {string} [prefix] of their ids
 */
export function pager(cursors, next, show, prefix = "") {
  return h("div", { class: "row" },
    h("button", { id: `${prefix}newer`, disabled: cursors.length === 1, onclick: () => void show(cursors.slice(0, -1)) }, "Newer"),
    h("button", { id: `${prefix}older`, disabled: !next, onclick: () => void show([...cursors, next ?? null]) }, "Older"));
}

/** Jobs that can be compared at once. */
export const MAX_COMPARED = 8;

/**
 * The page of one job, or the comparison of several; null for none or more than `MAX_COMPARED`.
 * @param {string[]} ids
 */
export function jobsPath(ids) {
  if (ids.length === 1) return `/jobs/${ids[0]}`;
  return ids.length > 0 && ids.length <= MAX_COMPARED ? `/compare?jobs=${ids.join(",")}` : null;
}

/**
 * A list of names and values; null values are left out.
 * @param {[name: string, value: Child][]} pairs
 */
export function facts(pairs) {
  return h("dl", { class: "facts" }, pairs.filter(([, value]) => value !== null && value !== undefined)
    .map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
}

/**
 * An error, with the list of faults of a problem document.
 * @param {Error & { errors?: Fault[] }} error
 */
export function errorBox(error) {
  const rows = (error.errors ?? []).map((one) => h("li", {}, h("code", {}, one.pointer), ` ${one.detail}`, one.allowed && ` (allowed: ${one.allowed})`));
  // The message names a single fault itself.
  return h("div", { class: "fault", role: "alert" }, error.message, rows.length > 1 && h("ul", {}, rows));
}

/**
 * A button that runs `work` on the server and announces the outcome. `ask` gives the question to confirm first.
 * @param {string} title @param {() => Promise<unknown>} work @param {{ is_main?: boolean, ask?: () => string }} [options]
 */
export function action(title, work, { is_main = false, ask } = {}) {
  const button = h("button", { type: "button", class: is_main ? "main" : undefined, onclick: async () => {
    if (ask && !confirm(ask())) return;
    button.disabled = true;
    try {
      const message = await work();
      announce(typeof message === "string" ? message : `${title}: done`);
    } catch (error) {
      announce(`${title}: ${/** @type {Error} */ (error).message}`);
    }
    button.disabled = false;
  } }, title);
  return button;
}

/**
 * The time since a moment, which `keepTime` renews.
 * @param {string} at
 */
export const since = (at) => h("time", { datetime: at, class: "since" }, ago(at));

/** Renews the times since a moment: a table is drawn again only when its rows change. */
export function keepTime() {
  const elements = /** @type {NodeListOf<HTMLTimeElement>} */ (document.querySelectorAll("time.since"));
  for (const element of elements) {
    const text = ago(element.dateTime);
    if (element.textContent !== text) element.textContent = text;
  }
}

/**
 * A select element with its label.
 * @param {string} label @param {Option[]} options @param {string} value @param {(value: string) => unknown} chosen
 */
export function choice(label, options, value, chosen) {
  const pairs = options.map((option) => (Array.isArray(option) ? option : [option, option]));
  const select = h("select", { onchange: () => void chosen(select.value) }, pairs.map(([value, title]) => h("option", { value }, title)));
  select.value = value;
  return h("label", { class: "field" }, label, select);
}

/**
 * Writes choices into the page's address, so that a copied link shows the same view. Empty values are removed.
 * @param {Record<string, string | number | null | undefined>} choices
 */
export function setParameters(choices) {
  const url = new URL(location.href);
  for (const [key, value] of Object.entries(choices)) {
    if (value === null || value === undefined || value === "") url.searchParams.delete(key);
    else url.searchParams.set(key, String(value));
  }
  history.replaceState(null, "", url);
}

/**
 * A parameter of the page's address.
 * @param {string} key
 */
export const parameter = (key) => new URLSearchParams(location.search).get(key);

/**
 * The label of a response with its unit; its meaning shows as a tooltip.
 * @param {OutputTable} outputs @param {string} name
 */
export function responseLabel(outputs, name) {
  const row = responseRow(outputs, name);
  return h("span", { title: row?.meaning }, labelOf(name, row?.unit));
}
