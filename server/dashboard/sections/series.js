// @ts-check
// One series of many jobs of a sweep, including running jobs.

import { readIfThere } from "../api.js";

/** Jobs whose series are read, the first by design point. */
const MAX_JOBS = 200;
/** Samples of each series. */
const SAMPLES = 200;

/**
 * The series of each trial, its unit, and whether there are more jobs; no trials where no job has it.
 * @param {string} at path of the sweep @param {string} name
 */
export async function seriesOfSweep(at, name) {
  /** @type {SweepSeries | null} */
  const page = await readIfThere(`${at}/series/${name}?samples=${SAMPLES}&limit=${MAX_JOBS}`);
  return { trials: (page?.items ?? []).filter((trial) => trial.t_s.length > 0), unit: page?.unit, has_more: Boolean(page?.next_cursor) };
}
