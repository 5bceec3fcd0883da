// What can be drawn of a design point: each response that is a number, and of each response in words the share of trials with each word.

import { number, titled } from "./format.js";

/** Wilson's interval of a share: also at 0 and 1 it says how little a few seeds tell. */
function ofShare(count, n) {
  const z = 1.96, share = count / n, spread = 1 + (z * z) / n;
  const middle = (share + (z * z) / (2 * n)) / spread;
  const half = (z / spread) * Math.sqrt((share * (1 - share)) / n + (z * z) / (4 * n * n));
  return { n, count, mean: share, low: Math.max(0, middle - half), high: Math.min(1, middle + half) };
}

function ofNumber(name, unit) {
  return {
    name, label: titled(name, unit), is_share: false,
    of: (row) => {
      const summary = row.responses[name];
      if (!summary || typeof summary.mean !== "number") return null;
      return { n: summary.n, mean: summary.mean, low: summary.low_95 ?? null, high: summary.high_95 ?? null };
    },
    ofTrial: (trial) => (typeof trial.responses[name] === "number" ? trial.responses[name] : null),
  };
}

function ofWord(name, word) {
  return {
    name: `${name}=${word}`, label: `share with ${name.replaceAll("_", " ")} ${word.replaceAll("_", " ")}`, is_share: true,
    of: (row) => {
      const summary = row.responses[name];
      return summary?.words && summary.n > 0 ? ofShare(summary.words[word] ?? 0, summary.n) : null;
    },
    ofTrial: () => null,
  };
}

/** Measures of these design points, in the order of their names; `name=word` are called as in the table of effects. Units are those of the table of results. */
export function measures(points, outputs) {
  const unit = (name) => outputs.responses.find((row) => row.name === name)?.unit;
  const [numbers, words] = [new Set(), new Set()];
  for (const row of points) {
    for (const [name, summary] of Object.entries(row.responses)) {
      if (typeof summary.mean === "number") numbers.add(name);
      for (const word of Object.keys(summary.words ?? {})) words.add(`${name}=${word}`);
    }
  }
  const shares = [...words].sort().map((pair) => ofWord(...pair.split(/=(.*)/s)));
  return [...[...numbers].sort().map((name) => ofNumber(name, unit(name))), ...shares];
}

/** The first of these names that there is. */
export function preferred(all, names) {
  return names.map((name) => all.find((one) => one.name === name)).find(Boolean);
}

/** Values of a factor as they are shown and compared: numbers as numbers, anything else as a word. */
export function level(value) {
  if (typeof value === "number") return value;
  return typeof value === "string" ? value : JSON.stringify(value);
}

/** The different values of a factor among points, ascending. */
export function levels(points, pointer) {
  const found = [...new Set(points.map((row) => level(row.factors[pointer])))];
  return found.sort((a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b))));
}

/** Sorts values into groups by their level, or, where those are many numbers, into `count` ranges of equal length: each a key to sort by and a title. */
export function grouped(values, most, count) {
  const found = [...new Set(values.map(level))];
  if (found.length <= most || found.some((value) => typeof value !== "number")) return (value) => ({ key: level(value), title: told(level(value)) });
  const low = Math.min(...found), length = (Math.max(...found) - low) / count;
  return (value) => {
    const i = Math.min(count - 1, Math.floor((value - low) / length));
    return { key: i, title: `${told(low + i * length)} to ${told(low + (i + 1) * length)}` };
  };
}

const told = (value) => number(value, 3);
