// @ts-check
// Why jobs wait, and when a job, sweep or study is expected to start and end.

import { poll } from "../api.js";
import { fill, h } from "../dom.js";
import { duration, plural, timeRange } from "../format.js";

/** Time between two reads of the forecast. */
const INTERVAL_S = 5;

/**
 * The forecast below a path. `update` says whether it has ended: nothing is read or shown from then on.
 * @param {string} at
 */
export function forecastOf(at) {
  const element = h("div", { id: "forecast" });
  /** @type {(() => void) | undefined} */
  let stop;
  /** @param {boolean} has_ended */
  function update(has_ended) {
    if (has_ended) {
      stop?.();
      stop = undefined;
      element.replaceChildren();
    } else {
      // An older server has no forecast: the rest of the page says what it knows.
      stop ??= poll(`${at}/forecast`, INTERVAL_S, (forecast) => stop && fill(element, sentences(forecast)), () => {});
    }
  }
  return { element, update };
}

/** @param {TimeForecast} forecast */
function sentences({ waiting, start, end, no_forecast, runs_left, basis }) {
  const expected = [start && `to start ${timeRange(start)}`, end && `to end ${timeRange(end)}`].filter((part) => part);
  const is_said = waiting.some(({ detail }) => detail === no_forecast);
  return [
    ...waiting.map(({ reason, jobs, detail }) => h("p", { "data-reason": reason }, jobs === 1 ? `Waits: ${detail}` : `${plural(jobs, "job")} wait: ${detail}`)),
    expected.length > 0 && h("p", { title: basis ? facts(basis) : undefined }, `Expected ${expected.join(", ")}.`,
      runs_left.least < runs_left.most && ` ${runs_left.least.toLocaleString("en")} to ${plural(runs_left.most, "run")} are left.`),
    no_forecast && !is_said && h("p", { class: "dim" }, `No forecast: ${no_forecast}.`),
  ];
}

/** @param {ForecastBasis} basis */
function facts({ slots, finished_runs, learned_from, share }) {
  const teachers = { sweep: "of its own", backend: "of other jobs", nothing: "" }[learned_from];
  const runs = learned_from === "nothing" ? "By a rough estimate, since no run has finished" : `By ${plural(finished_runs, "finished run")} ${teachers}`;
  return `${runs}, on ${plural(slots, "slot")}. ${Math.round(100 * share)} % of such ranges hold the true time.`;
}

/**
 * The forecast of a document that is not submitted.
 * @param {CostForecast} cost
 * @returns {[string, string][]}
 */
export function costFacts({ processor, duration: wall, end, no_forecast }) {
  const span = (/** @type {DurationRange} */ range) => `${duration(range.shortest_s)} to ${duration(range.longest_s)}`;
  return [["Processor time", processor ? span(processor) : "–"], ["On the present workers", wall && end ? `${span(wall)}, done ${timeRange(end)}` : (no_forecast ?? "–")]];
}
