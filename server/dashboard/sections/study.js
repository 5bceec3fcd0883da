// @ts-check
// The head of a study's page: state, runs of the budget, question, answer, and actions.

import { post } from "../api.js";
import { pointersOf } from "../document.js";
import { fill, h, withCode } from "../dom.js";
import { dateTime, factorLabel, plural } from "../format.js";
import { action, bar, facts } from "../parts.js";
import { dialog } from "./extend.js";
import { forecastOf } from "./forecast.js";

/** The reasons why a study is finished. */
const ENDS = { by_rule: "as certain as asked", by_budget: "budget spent", nothing_left: "no point left to run" };
/** Colours of states, named like states of jobs. */
const COLOURS = { running: "running", paused: "queued", finished: "succeeded", cancelled: "cancelled" };

/**
 * The state of a study as a coloured dot and its word.
 * @param {StudyView} study
 */
export function stateOfStudy({ state, finished }) {
  return h("span", { class: `state ${COLOURS[state]}` }, state === "finished" && finished ? `${state}: ${ENDS[finished]}` : state);
}

/**
 * The runs of a study as parts of its budget.
 * @param {StudyView} study
 */
export function runsBar({ name, runs }, is_large = false) {
  const ended = /** @type {[string, number][]} */ ([["succeeded", runs.done], ["failed", runs.failed], ["cancelled", runs.cancelled], ["running", runs.pending]]);
  const percent = Math.min(100, Math.floor((100 * (runs.done + runs.failed + runs.cancelled)) / runs.max_runs));
  return bar(`${name}: ${percent} % of the budget used`, percent, ended.map(([colour, count]) => [colour, count / runs.max_runs]), is_large);
}

/**
 * The head of a study; `answer` gets the study after an action. `setFactors` takes the ranges of a newer answer.
 * @param {string} at path of the study @param {StudyAnswer} first @param {(request: Promise<StudyView>) => Promise<void>} answer
 */
export function studyHead(at, first, answer) {
  const top = h("div"), forecast = forecastOf(at), runs = h("div", {}, top, forecast.element), words = h("section", { class: "card" }), buttons = actions(at, first, answer);
  /** @param {StudyView} study */
  function draw(study) {
    buttons.update(study);
    document.title = `${study.name} · Roost`;
    const { done, failed, cancelled, pending, max_runs, outside_budget } = study.runs;
    const count = (/** @type {number} */ number, /** @type {string} */ word) => h("span", {}, `${number.toLocaleString("en")} ${word}`);
    forecast.update(["finished", "cancelled"].includes(study.state));
    fill(top, runsBar(study, true),
      h("div", { class: "row", id: "runs" }, stateOfStudy(study), count(done, "done"), count(failed, "failed"), count(pending, "pending"), cancelled > 0 && count(cancelled, "cancelled"), (outside_budget ?? 0) > 0 && count(outside_budget ?? 0, "outside the budget"),
        h("span", {}, `budget of ${plural(max_runs, "run")}`), h("a", { href: `/sweeps/${study.id}` }, "Results and runs in flight")),
      facts([["Factors", study.factors.map((pointer) => factorLabel(pointer, study.factors)).join(", ")], ["Points", study.points.toLocaleString("en")],
        ["Submitted", dateTime(study.submitted_at)], ["Answered", dateTime(study.answered_at)], ["Identifier", h("span", { class: "mono" }, study.id)]]));
    fill(words, h("h2", {}, "Question"), h("p", { id: "question" }, withCode(study.question)), h("h2", {}, "Answer"),
      study.answer.length > 0 ? h("ul", { id: "answer" }, study.answer.map((sentence) => h("li", {}, withCode(sentence)))) : h("p", { class: "dim", id: "answer" }, "No answer yet."));
  }
  return { runs, words, bar: h("div", { class: "row" }, buttons.elements), draw, setFactors: buttons.setFactors };
}

/**
 * The actions on a study; those that apply are visible. Elements are made once, since a dialog may be open.
 * @param {string} at @param {StudyAnswer} first @param {(request: Promise<StudyView>) => Promise<void>} answer
 */
function actions(at, first, answer) {
  let { study, factors } = first;
  const pause = action("Pause", () => answer(post(`${at}/pause`))), resume = action("Resume", () => answer(post(`${at}/resume`)));
  const cancel = action("Cancel", () => answer(post(`${at}/cancel`)), { ask: () => `End this study and cancel ${plural(study.runs.pending, "run")}?` });
  const max_runs = h("input", { name: "max_runs", type: "number", step: 1, required: true });
  const [budget, budget_dialog] = dialog("Raise budget", h("p", {}, h("label", { class: "field" }, "Maximum number of runs", max_runs)), () => {
    max_runs.min = max_runs.value = String(study.runs.max_runs);
    return () => answer(post(`${at}/budget`, { max_runs: Number(max_runs.value) }));
  });
  const has_ranges = factors.some(({ levels }) => !levels);
  const [widen, widen_dialog] = widenDialog(() => factors, (ranges) => answer(post(`${at}/ranges`, { ranges })));
  /** @param {StudyView} next */
  function update(next) {
    study = next;
    pause.hidden = study.state !== "running";
    resume.hidden = study.state !== "paused";
    cancel.hidden = !["running", "paused"].includes(study.state);
    budget.hidden = study.state === "cancelled";
    widen.hidden = study.state === "cancelled" || !has_ranges;
  }
  const download = h("a", { href: `${at}/answer`, download: `${study.name}.json` }, "Answer document");
  return { elements: [pause, resume, cancel, budget, budget_dialog, widen, widen_dialog, download], update, setFactors: (/** @type {StudyAnswer["factors"]} */ next) => void (factors = next) };
}

/**
 * The dialog that widens the ranges of factors; a factor with levels has none. `read` gives the present ranges.
 * @param {() => StudyAnswer["factors"]} read @param {(ranges: { pointer: string, low: number, high: number }[]) => Promise<unknown>} post
 */
function widenDialog(read, post) {
  const pointers = read().map((factor) => pointersOf(factor)[0]);
  const rows = pointers.filter((_, index) => !read()[index].levels).map((pointer) => ({
    pointer, low: h("input", { type: "number", step: "any", required: true }), high: h("input", { type: "number", step: "any", required: true }),
  }));
  const label = (/** @type {string} */ end, /** @type {string} */ pointer) => `${end} ${factorLabel(pointer, pointers)}`;
  const inside = [h("p", { class: "dim" }, "Ranges can only grow: all runs are kept."),
    rows.map(({ pointer, low, high }) => h("p", { class: "row" }, h("label", { class: "field" }, label("Lowest", pointer), low), h("label", { class: "field" }, label("Highest", pointer), high)))];
  return dialog("Widen ranges", inside, () => {
    for (const { pointer, low, high } of rows) {
      const factor = read()[pointers.indexOf(pointer)];
      low.max = low.value = String(factor.low);
      high.min = high.value = String(factor.high);
    }
    return () => post(rows.map(({ pointer, low, high }) => ({ pointer, low: Number(low.value), high: Number(high.value) })));
  });
}
