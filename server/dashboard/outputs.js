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
 * Names of the series, those of the headline first. A scenario names the series of its surfaces itself, so these are left out.
 * @param {OutputTable} outputs
 */
export const seriesNames = ({ series }) => [...series].sort((a, b) => Number(b.headline) - Number(a.headline)).map((row) => row.name).filter((name) => !name.includes("<"));
