// A series of many jobs of a sweep at once, running ones as far as they are.

import { read } from "../api.js";

/** Curves are drawn of so many jobs: the first by design point. */
const MOST_JOBS = 200;
/** Samples of each: more than a plot has pixels between its grid lines. */
const SAMPLES = 200;

/** Trials (`job_id`, `point`, `t_s`, `values`) of a series by its name, its unit, and whether there are more jobs than that; nothing where no job has it. */
export async function seriesOfSweep(at, name) {
  const page = await read(`${at}/series/${name}?samples=${SAMPLES}&limit=${MOST_JOBS}`).catch((error) => (error.status === 404 ? { items: [] } : Promise.reject(error)));
  return { trials: page.items.filter((trial) => trial.t_s.length > 0), unit: page.unit, more: Boolean(page.next_cursor) };
}
