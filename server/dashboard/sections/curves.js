// @ts-check
// Curves of a sweep: one series of many jobs, grouped by design point or by a factor, each group as its mean in the band of its trials.

import { fill, h } from "../dom.js";
import { factorLabel } from "../format.js";
import { compareLevels, grouped } from "../measures.js";
import { parameter, choice, jobsPath, setParameters } from "../parts.js";
import { bandPlot, explainEnd } from "../plots/curves.js";
import { panel } from "../plots/plot.js";
import { seriesOfSweep } from "./series.js";

/** Groups that can be distinguished. */
const MAX_GROUPS = 12;
/** Ranges of a factor that has more values. */
const RANGES = 6;

/**
 * The card; `draw` gets the experiment's series, and the design points of the sweep.
 * @param {string} at path of the sweep @param {SweepView} sweep
 */
export function curves(at, sweep) {
  const grouping = sweep.points > MAX_GROUPS ? sweep.factors[0] : "point";
  const by = () => {
    const chosen = parameter("group");
    return chosen !== null && (sweep.factors.includes(chosen) || chosen === "point") ? chosen : grouping;
  };
  const series_choice = h("span"), note = h("span", { class: "dim" });
  const plot = panel("Curves", { size: "tall-plot", is_wide: true, controls: [series_choice,
    choice("Grouped by", [["point", "design point"], ...sweep.factors.map((pointer) => /** @type {Option} */ ([pointer, factorLabel(pointer, sweep.factors)]))], by(), (group) => {
      setParameters({ group });
      draw(...drawn);
    }), note] });
  /** @type {[SeriesRow[], PointRow[]]} */
  let drawn = [[], []];

  /** @param {SeriesRow[]} series @param {PointRow[]} points */
  async function draw(series, points) {
    drawn = [series, points];
    const row = series.find((one) => one.name === parameter("series")) ?? series[0];
    if (!row) return plot.draw(() => null);
    const { name } = row;
    if (!series_choice.contains(document.activeElement)) fill(series_choice, choice("Series", series.map((one) => one.name), name, (series) => {
      setParameters({ series });
      draw(...drawn);
    }));
    const { trials, unit, has_more } = await seriesOfSweep(at, name);
    const running = trials.filter((trial) => trial.partial).length;
    note.textContent = [has_more && `the first ${trials.length} jobs`, running > 0 && `${running} still running`, trials.length > 0 && explainEnd(row)].filter(Boolean).join(", ");
    const groups = groupsOf(trials, points);
    await plot.draw(() => (groups.length ? bandPlot(groups, row, unit) : null));
  }

  /**
   * Trials by design point or by the level of a factor, in order.
   * @param {JobSeries[]} trials @param {PointRow[]} points
   */
  function groupsOf(trials, points) {
    const factors = new Map(points.map((row) => [row.point, row.factors]));
    /** @type {Map<Level, { key: Level, name: string, replicates: JobSeries[], path?: string | null }>} */
    const groups = new Map();
    const known = trials.flatMap((trial) => {
      const levels = factors.get(trial.point);
      return levels ? [{ trial, levels }] : [];
    });
    const group = grouped(by() === "point" ? [] : known.map(({ levels }) => levels[by()]), MAX_GROUPS, RANGES);
    for (const { trial, levels } of known) {
      const { key, title } = by() === "point" ? { key: trial.point, title: sweep.factors.map((pointer) => group(levels[pointer]).title).join(", ") } : group(levels[by()]);
      const found = groups.get(key) ?? { key, name: by() === "point" ? title || "all" : `${factorLabel(by(), sweep.factors)} ${title}`, replicates: [] };
      found.replicates.push(trial);
      groups.set(key, found);
    }
    if (by() === "point") for (const group of groups.values()) group.path = jobsPath(group.replicates.map((trial) => trial.job_id));
    return [...groups.values()].sort((a, b) => compareLevels(a.key, b.key));
  }
  return { card: plot.card, draw };
}
