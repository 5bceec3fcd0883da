// Numbers, times and names as people read them.

import { now } from "./api.js";

/** A number in four digits. */
export function number(value, digits = 4) {
  if (value === null || value === undefined) return "–";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value) && Math.abs(value) < 1e6) return value.toLocaleString("en");
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return Number(value.toPrecision(digits)).toExponential().replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
}

/** So many of something. */
export const many = (count, word) => `${count.toLocaleString("en")} ${word}${count === 1 ? "" : "s"}`;

/** Seconds in words: 42 s, 3 min 20 s, 2 h 10 min, 3 d 4 h. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s} s`;
  const [units, sizes] = [["d", "h", "min", "s"], [86400, 3600, 60, 1]];
  const first = sizes.findIndex((size) => s >= size);
  const whole = Math.floor(s / sizes[first]);
  const rest = Math.floor((s % sizes[first]) / sizes[first + 1]);
  return `${whole} ${units[first]}${rest ? ` ${rest} ${units[first + 1]}` : ""}`;
}

/** How long ago. */
export function ago(at) {
  const seconds = (now() - Date.parse(at)) / 1000;
  return seconds < 2 ? "now" : `${duration(seconds)} ago`;
}

/** A moment in local time. */
export function moment(at) {
  return at ? new Date(at).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "medium" }) : "–";
}

const UNITS = [
  ["_n_m3", "N/m³"], ["_kg_m3", "kg/m³"], ["_j_m2", "J/m²"], ["_m_s2", "m/s²"], ["_m_s", "m/s"], ["_kg_s", "kg/s"], ["_deg_s", "°/s"], ["_rad_s", "rad/s"], ["_1_s", "1/s"], ["_deg", "°"],
  ["_per_s", "1/s"], ["_pa", "Pa"], ["_kg", "kg"], ["_mib", "MiB"], ["_s", "s"], ["_m", "m"], ["_j", "J"], ["_n", "N"],
];

/** The unit that a name ends in, and the rest of the name in words. */
export function named(name) {
  const [suffix, unit] = UNITS.find(([suffix]) => name.endsWith(suffix)) ?? ["", ""];
  return { words: name.slice(0, name.length - suffix.length).replaceAll("_", " "), unit };
}

/** A name with its unit: `gate_opening_m` is "gate opening (m)". */
export function titled(name, unit = named(name).unit) {
  const words = unit === named(name).unit ? named(name).words : name.replaceAll("_", " ");
  return unit && unit !== "1" ? `${words} (${unit})` : words;
}

/** A factor by its pointer: the last part, with the part before it where that alone would not tell. */
export function factor(pointer, among = [pointer]) {
  const parts = (text) => text.split("/").slice(1);
  const last = parts(pointer).at(-1);
  const is_shared = among.some((other) => other !== pointer && parts(other).at(-1) === last);
  return is_shared ? `${parts(pointer).at(-2)?.replaceAll("_", " ")}: ${titled(last)}` : titled(last);
}

/** The first and last digits of an identifier: UUIDv7 begin with their time. */
export function short(id) {
  return `${id.slice(0, 8)}…${id.slice(-4)}`;
}
