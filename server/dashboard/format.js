// @ts-check
// Numbers, times and names for people.

import { now } from "./api.js";
import { unitOf } from "./schema.js";

/**
 * A number with four significant digits; any other value as text.
 * @param {unknown} value
 */
export function number(value, digits = 4) {
  if (value === null || value === undefined) return "–";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value) && Math.abs(value) < 1e6) return value.toLocaleString("en");
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return Number(value.toPrecision(digits)).toExponential().replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
}

/**
 * A count and its noun: 1 job, 2 jobs.
 * @param {number} count @param {string} noun
 */
export const plural = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;

/**
 * Seconds in words: 42 s, 3 min 20 s, 2 h 10 min, 3 d 4 h.
 * @param {number} seconds
 */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s} s`;
  const units = ["d", "h", "min", "s"], sizes = [86400, 3600, 60, 1];
  const first = sizes.findIndex((size) => s >= size);
  const whole = Math.floor(s / sizes[first]);
  const rest = Math.floor((s % sizes[first]) / sizes[first + 1]);
  return `${whole} ${units[first]}${rest ? ` ${rest} ${units[first + 1]}` : ""}`;
}

/**
 * Time since a timestamp.
 * @param {string} at
 */
export function ago(at) {
  const seconds = (now() - Date.parse(at)) / 1000;
  return seconds < 2 ? "now" : `${duration(seconds)} ago`;
}

/**
 * Date and time of day, in the viewer's time zone.
 * @param {string | null | undefined} at
 */
export function dateTime(at) {
  return at ? new Date(at).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "medium" }) : "–";
}

/**
 * A range of time in the viewer's time zone: "14:05 to 14:20", with the date unless it is today.
 * @param {TimeRange} range
 */
export function timeRange({ earliest, latest }) {
  const [first, last] = [new Date(earliest), new Date(latest)], today = new Date(now()).toDateString();
  const shown = (/** @type {Date} */ at, /** @type {string} */ known) =>
    at.toLocaleString("en-GB", at.toDateString() === known ? { timeStyle: "short" } : { dateStyle: "medium", timeStyle: "short" });
  const [from, to] = [shown(first, today), shown(last, first.toDateString())];
  return first.toDateString() === last.toDateString() && from.endsWith(to) ? from : `${from} to ${to}`;
}

/**
 * The last part of a name that has this unit: `_kg_m3` for kg/m³.
 * @param {string} unit
 */
export const unitSuffix = (unit) => `_${unit.toLowerCase().replace("°", "deg").replace("²", "2").replace("³", "3").replaceAll("/", "_")}`;

/**
 * The label of a name with its unit: `gate_opening_m` in m gives "gate opening (m)".
 * @param {string} name @param {string | null} [unit]
 */
export function labelOf(name, unit) {
  const suffix = unit ? unitSuffix(unit) : "";
  const words = (name.endsWith(suffix) ? name.slice(0, name.length - suffix.length) : name).replaceAll("_", " ");
  return unit && unit !== "1" ? `${words} (${unit})` : words;
}

/**
 * The label of a factor: the last part of its pointer, after the part before it where two factors end alike.
 * @param {string} pointer @param {string[]} [pointers] all factors
 */
export function factorLabel(pointer, pointers = [pointer]) {
  const parts = (/** @type {string} */ text) => text.split("/").slice(1);
  // The factor of a calibration's tests is no field.
  const last = parts(pointer).at(-1) ?? pointer;
  const is_shared = pointers.some((other) => other !== pointer && parts(other).at(-1) === last);
  const label = labelOf(last, unitOf(pointer));
  return is_shared ? `${parts(pointer).at(-2)?.replaceAll("_", " ")}: ${label}` : label;
}

/**
 * The first and last digits of an identifier. The first digits of a UUIDv7 are its time.
 * @param {string} id
 */
export function shortId(id) {
  return `${id.slice(0, 8)}…${id.slice(-4)}`;
}
