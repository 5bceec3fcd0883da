// @ts-check
// The JSON schema of scenarios, read once for each page. Labels of fields take their units from it.

import { read } from "./api.js";

/** @type {Schema | undefined} */
let schema;

/** @returns {Promise<Schema>} */
export async function readSchema() {
  return (schema ??= await read("/v1/schema/scenario"));
}

/**
 * The unit of a scenario's field; empty for a field without a unit, and as long as the schema has not been read.
 * @param {string} pointer
 */
export function unitOf(pointer) {
  const inside = (/** @type {Schema | undefined} */ at, /** @type {string} */ name) => at?.properties?.[name] ?? at?.items;
  return pointer.split("/").slice(1).reduce(inside, schema)?.["x-unit"] ?? "";
}
