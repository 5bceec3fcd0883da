// Curves of a sweep: a series of many jobs, grouped by design point or by a factor, each group as its mean in the band that its trials span.

import { fill, h } from "../dom.js";
import { factor } from "../format.js";
import { grouped } from "../measures.js";
import { asked, choice, pathTo, remember } from "../parts.js";
import { bandPlot, endOf } from "../plots/curves.js";
import { panel } from "../plots/plot.js";
import { seriesOfSweep } from "./series.js";

/** More groups of curves than this cannot be told apart. */
const MOST_GROUPS = 12;
/** A factor that takes more values than that is cut into so many ranges. */
const RANGES = 6;

/** The card; `draw` gets the names of series that the experiment has, and the sweep's design points. */
export function curves(at, sweep) {
  const grouping = sweep.points > MOST_GROUPS ? sweep.factors[0] : "point";
  const by = () => (sweep.factors.includes(asked("group")) || asked("group") === "point" ? asked("group") : grouping);
  const names = h("span"), note = h("span", { class: "dim" });
  const one = panel("Curves", { size: "tall-plot", whole: true, controls: [names,
    choice("Grouped by", [["point", "design point"], ...sweep.factors.map((pointer) => [pointer, factor(pointer, sweep.factors)])], by(), (group) => (remember({ group }), draw(...known))), note] });
  let known = [[], []];

  async function draw(series, points) {
    known = [series, points];
    const name = series.includes(asked("series")) ? asked("series") : series[0];
    if (!names.contains(document.activeElement)) fill(names, choice("Series", series, name, (series) => (remember({ series }), draw(...known))));
    const { trials, unit, more } = await seriesOfSweep(at, name);
    const running = trials.filter((trial) => trial.partial).length;
    note.textContent = [more && `the first ${trials.length} jobs`, running > 0 && `${running} still running`, trials.length > 0 && endOf(name)].filter(Boolean).join(", ");
    const groups = groupsOf(trials, points);
    await one.draw(() => (groups.length ? bandPlot(groups, name, unit) : null));
  }

  /** Trials by design point or by the level of a factor, in their order. */
  function groupsOf(trials, points) {
    const factors = new Map(points.map((row) => [row.point, row.factors])), groups = new Map();
    const there = trials.filter((trial) => factors.has(trial.point));
    const group = grouped(by() === "point" ? [] : there.map((trial) => factors.get(trial.point)[by()]), MOST_GROUPS, RANGES);
    for (const trial of there) {
      const levels = factors.get(trial.point);
      const { key, title } = by() === "point" ? { key: trial.point, title: sweep.factors.map((pointer) => group(levels[pointer]).title).join(", ") } : group(levels[by()]);
      if (!groups.has(key)) groups.set(key, { key, name: by() === "point" ? title || "all" : `${factor(by(), sweep.factors)} ${title}`, replicates: [] });
      groups.get(key).replicates.push(trial);
    }
    if (by() === "point") for (const group of groups.values()) group.path = pathTo(group.replicates.map((trial) => trial.job_id));
    return [...groups.values()].sort((a, b) => (typeof a.key === "number" ? a.key - b.key : String(a.key).localeCompare(String(b.key))));
  }
  return { card: one.card, draw };
}
