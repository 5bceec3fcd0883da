// @ts-check
// Measures of design points: each numeric response, the share of trials of each indicator, and for each response in words the share of trials with one word.

import { labelOf, number } from "./format.js";
import { responseRow } from "./outputs.js";

/**
 * @param {string} name @param {string | undefined} unit
 * @returns {Measure}
 */
function numericMeasure(name, unit) {
  return {
    name, label: labelOf(name, unit), is_share: false,
    of: (row) => {
      const summary = row.responses[name];
      if (!summary || typeof summary.mean !== "number") return null;
      return { n: summary.n, mean: summary.mean, low: summary.low_95 ?? null, high: summary.high_95 ?? null };
    },
    ofTrial: (trial) => {
      const value = trial.responses[name];
      return typeof value === "number" ? value : null;
    },
  };
}

/**
 * The share of trials in which an event happened, with the server's interval.
 * @param {string} name
 * @returns {Measure}
 */
function indicatorMeasure(name) {
  const number = numericMeasure(name, undefined);
  return {
    ...number, label: `share ${name.replaceAll("_", " ")}`, is_share: true,
    of: (row) => {
      const value = number.of(row);
      return value && { ...value, count: Math.round(value.mean * value.n) };
    },
  };
}

/**
 * @param {string} name @param {string} word
 * @returns {Measure}
 */
function wordMeasure(name, word) {
  return {
    name: `${name}=${word}`, label: `share with ${name.replaceAll("_", " ")} ${word.replaceAll("_", " ")}`, is_share: true,
    of: (row) => {
      const summary = row.responses[name];
      if (!summary?.words || summary.n === 0) return null;
      const count = summary.words[word] ?? 0, interval = summary.shares?.[word] ?? { low_95: 0, high_95: summary.unseen_high_95 };
      return { n: summary.n, count, mean: count / summary.n, low: interval.low_95, high: interval.high_95 ?? null };
    },
    ofTrial: () => null,
  };
}

/**
 * Measures of these design points by name, shares of words last. Such a share is named `name=word`, as in the table of effects.
 * @param {PointRow[]} points @param {OutputTable} outputs
 */
export function measures(points, outputs) {
  /** @type {[Set<string>, Set<string>]} */
  const [numbers, words] = [new Set(), new Set()];
  for (const row of points) {
    for (const [name, summary] of Object.entries(row.responses)) {
      if (typeof summary.mean === "number") numbers.add(name);
      for (const word of Object.keys(summary.words ?? {})) words.add(`${name}=${word}`);
    }
  }
  const shares = [...words].sort().map((pair) => wordMeasure(pair.slice(0, pair.indexOf("=")), pair.slice(pair.indexOf("=") + 1)));
  const measureOf = (/** @type {string} */ name) => {
    const row = responseRow(outputs, name);
    return row?.type === "indicator" ? indicatorMeasure(name) : numericMeasure(name, row?.unit);
  };
  return [...[...numbers].sort().map(measureOf), ...shares];
}

/**
 * The measure with the first of these names that exists.
 * @param {Measure[]} all @param {string[]} names
 */
export function preferred(all, names) {
  return names.map((name) => all.find((one) => one.name === name)).find(Boolean);
}

/**
 * The value of a factor as it is shown and compared: a number, or text for any other value.
 * @param {unknown} value @returns {Level}
 */
export function level(value) {
  if (typeof value === "number") return value;
  return typeof value === "string" ? value : JSON.stringify(value);
}

/**
 * The different levels of a factor, ascending.
 * @param {{ factors: Record<string, unknown> }[]} points @param {string} pointer
 */
export function levels(points, pointer) {
  return [...new Set(points.map((row) => level(row.factors[pointer])))].sort(compareLevels);
}

/**
 * Numbers by size, words by the alphabet.
 * @param {Level | null} a @param {Level | null} b
 */
export const compareLevels = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b)));

/**
 * A function that gives the group of a value: its level, or one of `count` ranges of equal length where there are more than `max` numbers.
 * @param {unknown[]} values @param {number} max @param {number} count
 * @returns {(value: unknown) => { key: Level, title: string }}
 */
export function grouped(values, max, count) {
  const found = [...new Set(values.map(level))], numbers = found.filter((value) => typeof value === "number");
  if (found.length <= max || numbers.length < found.length) return (value) => ({ key: level(value), title: number(level(value), 3) });
  const low = Math.min(...numbers), length = (Math.max(...numbers) - low) / count;
  return (value) => {
    const i = Math.min(count - 1, Math.floor((Number(value) - low) / length));
    return { key: i, title: `${number(low + i * length, 3)} to ${number(low + (i + 1) * length, 3)}` };
  };
}
