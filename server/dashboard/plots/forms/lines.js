// Means of design points as lines over one factor: a line for each combination of the others.

import { factor, number } from "../../format.js";
import { level } from "../../measures.js";
import { told } from "../response.js";

/** Lines in ascending order of `x`, with how far their 95 % intervals reach up and down, what each point is and where a click on it leads. */
export function lines({ points, factors, x, measure, path }) {
  const others = factors.filter((pointer) => pointer !== x), found = new Map();
  for (const row of points) {
    const value = measure.of(row);
    if (!value) continue;
    const name = others.map((pointer) => `${factor(pointer, factors)} ${number(level(row.factors[pointer]))}`).join(", ") || "all";
    if (!found.has(name)) found.set(name, []);
    found.get(name).push({ row, value, at: level(row.factors[x]) });
  }
  return [...found].map(([name, all]) => {
    const sorted = all.sort((a, b) => (typeof a.at === "number" ? a.at - b.at : String(a.at).localeCompare(String(b.at))));
    const of = (pick) => sorted.map(pick);
    return {
      name, rows: of(({ row }) => row), x: of(({ at }) => at), mean: of(({ value }) => value.mean),
      up: of(({ value }) => (value.high === null ? 0 : value.high - value.mean)), down: of(({ value }) => (value.low === null ? 0 : value.mean - value.low)),
      path: of(({ row }) => path?.(row) ?? null), told: of(({ row, value }) => told(row.factors, factors, `${measure.label} ${number(value.mean)} of ${value.n}<br>point ${row.point}: click for its jobs`)),
    };
  });
}
