// Parts that several pages share: states, progress bars, tables, faults.

import { h, say } from "./dom.js";

export const STATES = ["queued", "running", "succeeded", "failed", "cancelled"];
/** Why jobs fail. */
export const CLASSES = ["invalid", "unstable", "worker", "lost", "timeout"];

/** A state as a coloured dot and its word. */
export function state(word, note) {
  return h("span", { class: `state ${word}` }, note ? `${word}: ${note}` : word);
}

/** The state of a sweep follows from its counts. */
export function stateOfSweep(counts) {
  if (counts.running > 0) return "running";
  if (counts.queued > 0) return "queued";
  if (counts.failed > 0) return "failed";
  return counts.cancelled > 0 ? "cancelled" : "succeeded";
}

export const total = (counts) => STATES.reduce((sum, state) => sum + counts[state], 0);

/** How far a sweep is: what has ended by its end, and what of the rest running jobs have done. */
export function progress(sweep, is_large = false) {
  const all = Math.max(1, total(sweep.counts));
  const ended = ["succeeded", "failed", "cancelled"].map((state) => [state, sweep.counts[state] / all]);
  const underway = Math.max(0, sweep.fraction - ended.reduce((sum, [, share]) => sum + share, 0));
  const parts = [...ended, ["running", underway]].filter(([, share]) => share > 0);
  const percent = Math.floor(100 * sweep.fraction);
  return h(
    "div",
    { class: is_large ? "bar large" : "bar", role: "progressbar", "aria-valuemin": 0, "aria-valuemax": 100, "aria-valuenow": percent,
      "aria-label": `${sweep.name}: ${percent} % done` },
    parts.map(([state, share]) => h("span", { class: state, style: { "--part": `${100 * share}%` } })),
  );
}

/** Counts in words, those that are not zero. */
export function counts(of) {
  return STATES.filter((state) => of[state] > 0).map((word) => state(`${word}`, of[word].toLocaleString("en")));
}

/** How many failed of each class, as links to those jobs. */
export function failures(sweep, path) {
  const classes = Object.entries(sweep.failures ?? {}).filter(([, count]) => count > 0);
  return classes.length > 0 && h("span", { class: "row counts" }, classes.map(([name, count]) =>
    h("a", { href: `${path}?state=failed&failure=${name}#jobs`, class: "failure" }, `${count.toLocaleString("en")} ${name}`)));
}

/**
 * A table. Columns have `title`, `cell(row)` and, where they are numbers, `is_number`. With `sort` (`{by, down}`) and `sorted`
 * headings are buttons.
 */
export function table(caption, columns, rows, { sort, sorted } = {}) {
  const kind = (column) => (column.is_number ? "number" : column.is_text ? "text" : undefined);
  const heading = (column, i) => {
    if (!sorted || !column.value) return h("th", { scope: "col", class: kind(column) }, column.title);
    const is_here = sort?.by === i;
    const turn = () => sorted({ by: i, down: is_here ? !sort.down : false });
    const order = is_here ? (sort.down ? "descending" : "ascending") : undefined;
    const arrow = is_here ? (sort.down ? " ▾" : " ▴") : "";
    return h("th", { scope: "col", class: kind(column), "aria-sort": order },
      h("button", { id: `sort-${i}-${caption.length}`, onclick: turn }, column.title + arrow));
  };
  return h("table", {}, h("caption", {}, caption),
    h("thead", {}, h("tr", {}, columns.map(heading))),
    h("tbody", {}, rows.map((row) => h("tr", {}, columns.map((column) => h("td", { class: kind(column) }, column.cell(row)))))));
}

/** Rows in the order of a column. */
export function inOrder(rows, columns, sort) {
  const value = columns[sort?.by]?.value;
  if (!value) return rows;
  const rank = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a ?? "").localeCompare(String(b ?? "")));
  const sign = sort.down ? -1 : 1;
  return [...rows].sort((a, b) => {
    const [left, right] = [value(a), value(b)];
    // What has no value comes last either way.
    if (left === null || left === undefined) return 1;
    if (right === null || right === undefined) return -1;
    return sign * rank(left, right);
  });
}

/** More jobs than this cannot be told apart side by side. */
export const MOST_COMPARED = 8;

/** Where to see these jobs: one on its page, several side by side; nowhere if they are too many. */
export function pathTo(ids) {
  if (ids.length === 1) return `/jobs/${ids[0]}`;
  return ids.length > 0 && ids.length <= MOST_COMPARED ? `/compare?jobs=${ids.join(",")}` : null;
}

/** A list of facts. */
export function facts(pairs) {
  return h("dl", { class: "facts" }, pairs.filter(([, value]) => value !== null && value !== undefined)
    .map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
}

/** A problem with all its faults. */
export function fault(error) {
  const rows = (error.errors ?? []).map((one) => h("li", {}, h("code", {}, one.pointer), ` ${one.detail}`, one.allowed && ` (allowed: ${one.allowed})`));
  // The message about a single fault names it already.
  return h("div", { class: "fault", role: "alert" }, error.message, rows.length > 1 && h("ul", {}, rows));
}

/** A button that does something on the server, and says how it went; `ask()` is what is asked before. */
export function action(title, work, { is_main = false, ask } = {}) {
  const button = h("button", { type: "button", class: is_main ? "main" : undefined, onclick: async () => {
    if (ask && !confirm(ask())) return;
    button.disabled = true;
    try {
      const told = await work();
      say(typeof told === "string" ? told : `${title}: done`);
    } catch (error) {
      say(`${title}: ${error.message}`);
    }
    button.disabled = false;
  } }, title);
  return button;
}

/** A choice with its label; `options` are words or pairs of value and title. */
export function choice(label, options, value, chosen) {
  const pairs = options.map((option) => (Array.isArray(option) ? option : [option, option]));
  const select = h("select", { onchange: () => chosen(select.value) }, pairs.map(([value, title]) => h("option", { value }, title)));
  select.value = value;
  return h("label", { class: "field" }, label, select);
}

/** Keeps what was chosen in the address, so that the state can be sent to somebody. */
export function remember(choices) {
  const url = new URL(location.href);
  for (const [key, value] of Object.entries(choices)) {
    if (value === null || value === undefined || value === "") url.searchParams.delete(key);
    else url.searchParams.set(key, value);
  }
  history.replaceState(null, "", url);
}

export const asked = (key) => new URLSearchParams(location.search).get(key);
