// @ts-check
// The head of a sweep's page: progress, speed, failures by class, and actions.

import { idempotentPost, post } from "../api.js";
import { fill, h } from "../dom.js";
import { factorLabel, plural, dateTime } from "../format.js";
import { action, counts, facts, failures, progress, state, stateOfSweep, total } from "../parts.js";
import { extend, retry } from "./extend.js";
import { forecastOf } from "./forecast.js";

/** The speed is averaged over this time. */
const WINDOW_MS = 300e3;

/**
 * The head of a sweep; `answer` gets the sweep after an action.
 * @param {string} at path of the sweep @param {SweepView} sweep @param {(request: Promise<SweepView>) => Promise<void>} answer
 */
export function head(at, sweep, answer) {
  const top = h("div"), forecast = forecastOf(at), element = h("div", {}, top, forecast.element), speed = speedometer(), buttons = actions(at, sweep, answer), bar = h("div", { class: "row" }, buttons.elements);
  /** @param {SweepView} sweep */
  function draw(sweep) {
    speed.add(sweep);
    buttons.update(sweep);
    document.title = `${Math.floor(100 * sweep.fraction)} % ${sweep.name} · Roost`;
    forecast.update(sweep.counts.queued + sweep.counts.running === 0);
    fill(top, progress(sweep, true),
      h("div", { class: "row" }, state(stateOfSweep(sweep.counts)), h("span", {}, `${(100 * sweep.fraction).toFixed(1)} % of ${plural(total(sweep.counts), "job")}`),
        h("span", { class: "row counts" }, counts(sweep.counts), (sweep.paused ?? 0) > 0 && h("span", { class: "dim" }, `${(sweep.paused ?? 0).toLocaleString("en")} paused`)), failures(sweep, `/sweeps/${sweep.id}`), speed.text(sweep),
        sweep.is_study && h("a", { href: `/studies/${sweep.id}` }, "Question and answer of the study")),
      facts([["Design", `${sweep.design.replaceAll("_", " ")}: ${plural(sweep.points, "point")} × ${sweep.replicates}`],
        ["Factors", sweep.factors.map((pointer) => factorLabel(pointer, sweep.factors)).join(", ") || null],
        ["Submitted", dateTime(sweep.submitted_at)], ["Identifier", h("span", { class: "mono" }, sweep.id)]]));
  }
  return { element, bar, draw };
}

/** Jobs per hour over the last minutes. */
function speedometer() {
  /** @type {{ at: number, fraction: number }[]} */
  const samples = [];
  return {
    /** @param {SweepView} sweep */
    add(sweep) {
      samples.push({ at: Date.now(), fraction: sweep.fraction });
      while (samples.length > 2 && Date.now() - samples[0].at > WINDOW_MS) samples.shift();
    },
    /** @param {SweepView} sweep */
    text(sweep) {
      const first = samples[0], last = samples[samples.length - 1], gained = last.fraction - first.fraction;
      if (gained <= 0 || last.at - first.at < 2000 || sweep.fraction >= 1) return null;
      const per_s = (1000 * gained) / (last.at - first.at);
      return h("span", { class: "dim" }, `${(3600 * per_s * total(sweep.counts)).toPrecision(3)} jobs per hour`);
    },
  };
}

/**
 * The actions on a sweep; those that apply are visible. Elements are made once, since a dialog may be open.
 * @param {string} at @param {SweepView} first @param {(request: Promise<SweepView>) => Promise<void>} answer
 */
function actions(at, first, answer) {
  let counts = first.counts;
  const unended = () => counts.queued + counts.running, failed = () => counts.failed + counts.cancelled;
  const cancel = action("Cancel", () => answer(post(`${at}/cancel`)), { ask: () => `Cancel ${plural(unended(), "job")}?` });
  const pause = action("Pause", () => answer(post(`${at}/pause`))), resume = action("Resume", () => answer(post(`${at}/resume`)));
  const [retry_button, retry_dialog] = retry(failed, (query) => answer(post(`${at}/retry${query}`)));
  const download = h("details", { class: "menu" }, h("summary", {}, "Download"), ["csv", "json", "parquet"].map((format) =>
    h("a", { href: `${at}/results?format=${format}`, download: `${first.name}.${format}`, class: "row" }, format)));
  /** @param {SweepView} sweep */
  function update(sweep) {
    const { paused = 0 } = sweep;
    counts = sweep.counts;
    pause.hidden = unended() <= paused;
    resume.hidden = paused === 0;
    cancel.hidden = unended() === 0;
    retry_button.hidden = failed() === 0;
  }
  const extension = extend(first, () => {
    const send = idempotentPost(`${at}/extend`);
    return (request) => answer(send(request));
  });
  // A study chooses its runs itself.
  return { elements: [pause, resume, cancel, retry_button, retry_dialog, !first.is_study && extension, h("a", { href: `/submit?clone=${first.id}` }, "Clone"), download], update };
}
