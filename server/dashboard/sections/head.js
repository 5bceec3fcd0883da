// The head of a sweep's page: how far it is and how fast, what failed and of what class, and what can be done to it.

import { maker, post } from "../api.js";
import { fill, h } from "../dom.js";
import { duration, factor, many, moment } from "../format.js";
import { action, counts, facts, failures, progress, state, stateOfSweep, total } from "../parts.js";
import { extend, retry } from "./extend.js";

/** Paces are told from what was seen in this time. */
const SEEN_MS = 300e3;

/** `element` and `bar` of a sweep at a path; `changed` gets the sweep after something was done to it. */
export function head(at, sweep, changed) {
  const element = h("div"), pace = paced(), can = actions(at, sweep, changed), bar = h("div", { class: "row" }, can.elements);
  function draw(sweep) {
    pace.seen(sweep);
    can.show(sweep);
    document.title = `${Math.floor(100 * sweep.fraction)} % ${sweep.name} · Roost`;
    fill(element, progress(sweep, true),
      h("div", { class: "row" }, state(stateOfSweep(sweep.counts)), h("span", {}, `${(100 * sweep.fraction).toFixed(1)} % of ${many(total(sweep.counts), "job")}`),
        h("span", { class: "row counts" }, counts(sweep.counts)), failures(sweep, `/sweeps/${sweep.id}`), pace.told(sweep)),
      facts([["Design", `${sweep.design.replaceAll("_", " ")}: ${many(sweep.points, "point")} × ${sweep.replicates}`],
        ["Factors", sweep.factors.map((pointer) => factor(pointer, sweep.factors)).join(", ") || null],
        ["Submitted", moment(sweep.submitted_at)], ["Identifier", h("span", { class: "mono" }, sweep.id)]]));
  }
  return { element, bar, draw };
}

/** How fast a sweep gets on, from what was seen in the last minutes, and how long it will take at that. */
function paced() {
  const seen = [];
  return {
    seen(sweep) {
      seen.push({ at: Date.now(), fraction: sweep.fraction });
      while (seen.length > 2 && Date.now() - seen[0].at > SEEN_MS) seen.shift();
    },
    told(sweep) {
      const first = seen[0], last = seen.at(-1), gained = last.fraction - first.fraction;
      if (gained <= 0 || last.at - first.at < 2000 || sweep.fraction >= 1) return null;
      const per_s = (1000 * gained) / (last.at - first.at);
      return h("span", { class: "dim" }, `${(3600 * per_s * total(sweep.counts)).toPrecision(3)} jobs an hour, ${duration((1 - sweep.fraction) / per_s)} left`);
    },
  };
}

/** What can be done to a sweep, each shown while it makes sense. Their elements stay: somebody may be writing into a dialog. */
function actions(at, first, changed) {
  let counts = first.counts;
  const under_way = () => counts.queued + counts.running, undone = () => counts.failed + counts.cancelled;
  const cancel = action("Cancel", () => post(`${at}/cancel`).then(changed), { ask: () => `Cancel ${many(under_way(), "job")}?` });
  const [again, asks] = retry(undone, (wanted) => post(`${at}/retry${wanted}`).then(changed));
  const download = h("details", { class: "menu" }, h("summary", {}, "Download"), ["csv", "json", "parquet"].map((format) =>
    h("a", { href: `${at}/results?format=${format}`, download: `${first.name}.${format}`, class: "row" }, format)));
  function show(sweep) {
    counts = sweep.counts;
    cancel.hidden = under_way() === 0;
    again.hidden = undone() === 0;
  }
  const more = extend(first, () => {
    const made = maker(`${at}/extend`);
    return (wanted) => made(wanted).then(changed);
  });
  return { elements: [cancel, again, asks, more, h("a", { href: `/submit?clone=${first.id}` }, "Clone"), download], show };
}
