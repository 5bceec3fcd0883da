// @ts-check
// The server's table of results: name, unit and meaning of each response, series and curve, and the experiments that have it.

import { read } from "./api.js";

/**
 * The table of all experiments.
 * @returns {Promise<OutputTable>}
 */
export const readOutputs = () => read("/v1/responses");

/**
 * The table of one experiment.
 * @param {string} experiment @returns {Promise<OutputTable>}
 */
export async function readOutputsOf(experiment) {
  const table = await readOutputs();
  /**
   * @template {{ experiments: string[] }} Row
   * @param {Row[]} rows
   */
  const own = (rows) => rows.filter((row) => row.experiments.includes(experiment));
  return { responses: own(table.responses), series: own(table.series), curves: own(table.curves) };
}

/**
 * The row of a response; undefined for a response of an earlier version.
 * @param {OutputTable} outputs @param {string} name
 */
export const responseRow = ({ responses }, name) => responses.find((row) => row.name === name);

/**
 * The responses that pages show first.
 * @param {OutputTable} outputs
 */
export const headlineOf = ({ responses }) => responses.filter((row) => row.headline);

/**
 * The series: the headline first, and among these the series that few experiments have. A scenario names the series of its surfaces
 * itself, so these are left out.
 * @param {OutputTable} outputs
 */
export function seriesRows({ series }) {
  const sorted = [...series].sort((a, b) => Number(b.headline) - Number(a.headline) || a.experiments.length - b.experiments.length);
  return sorted.filter((row) => !row.name.includes("<"));
}

/**
 * Whether each point of a series or curve is of one body.
 * @param {OutputTable} outputs @param {Series | Curve} data
 */
export const isPerBody = ({ curves }, data) => "over" in data && curves.some((row) => row.per_body && row.name === data.name && row.over === data.over);
