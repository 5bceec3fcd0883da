// The results of an experiment, as the server's table lists them.

import { read } from "./api.js";

/** Responses, series and curves of an experiment, in their order. */
export async function outputsOf(experiment) {
  const table = await read("/v1/responses");
  const own = (rows) => rows.filter((row) => row.experiments.includes(experiment));
  return { responses: own(table.responses), series: own(table.series), curves: own(table.curves) };
}

/** Names of the responses that are shown first. */
export const headline = ({ responses }) => responses.filter((row) => row.headline).map((row) => row.name);

/** Names of series; those of single surfaces are named by the scenario. */
export const seriesNames = ({ series }) => [...series].sort((a, b) => b.headline - a.headline).map((row) => row.name).filter((name) => !name.includes("<"));

/** Units of the responses of all experiments, by name. */
export async function units() {
  const { responses } = await read("/v1/responses");
  return new Map(responses.map((row) => [row.name, row.unit]));
}
