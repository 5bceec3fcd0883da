// @ts-check
// The parameter library: published intervals beside the fields of the form, each with its source.

import { read } from "./api.js";
import { h, withCode } from "./dom.js";
import { plural } from "./format.js";

/** @returns {Promise<ParameterLibrary>} */
export const readLibrary = () => read("/v1/parameters");

/**
 * The numbers of an entry in words.
 * @param {ParameterEntry} entry
 */
function numbersOf({ low, high, n, single_value, unit, test }) {
  const has_interval = typeof low === "number" && typeof high === "number";
  if (has_interval) return `${low} to ${high} ${unit}`.trim() + (n ? `, n = ${n}` : "");
  const alone = typeof single_value === "number" ? ` (${single_value} ${unit}`.trimEnd() + " alone)" : "";
  return `no interval published${alone}; test: ${test}`;
}

/**
 * The published values of a field, folded; null where the library has no entry for it.
 * @param {ParameterLibrary} library @param {string} pointer
 */
export function publishedValues({ entries, sources }, pointer) {
  const own = entries.filter((entry) => entry.fields.includes(pointer));
  if (own.length === 0) return null;
  const intervals = own.filter((entry) => entry.status === "interval").length;
  const rows = own.map((entry) => {
    const source = sources.find((one) => one.key === entry.source);
    const product = entry.counterpart ? `${entry.product} on ${entry.counterpart}` : entry.product;
    return h("li", {}, h("b", {}, `${product}: `), `${numbersOf(entry)} (${entry.conditions}). `, withCode(entry.mapping), " ",
      source && h("a", { href: source.url, rel: "noreferrer", title: source.citation }, source.short), `, ${entry.place}`);
  });
  return h("details", { class: "published" }, h("summary", {}, intervals > 0 ? `${plural(intervals, "published interval")}` : "no published interval"), h("ul", {}, rows));
}
