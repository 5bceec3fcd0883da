// A sweep's document and the fields of its form: what the schema says of each field, and how text becomes a value, levels or a range.

/** All fields of the schema, section by section. */
export function fields(schema, at = "", found = [], only = null) {
  for (const [name, property] of Object.entries(schema.properties)) {
    const pointer = `${at}/${name}`;
    const here = /Only in the experiment `(\w+)`/.exec(property.description ?? "")?.[1] ?? only;
    if (property.type === "object" && property.properties && property.default === undefined) {
      fields(property, pointer, found, here);
      continue;
    }
    found.push(field(pointer, property, { section: at, section_doc: schema.description, only: here }));
  }
  return found;
}

function field(pointer, property, { section, section_doc, only }) {
  const doc = property.description ?? "";
  const types = [property.type].flat();
  const words = property.enum ?? (types.includes("boolean") ? ["true", "false"] : []);
  const [low, high] = [property.minimum ?? property.exclusiveMinimum, property.maximum ?? property.exclusiveMaximum];
  const range = low !== undefined && high !== undefined ? `${property.exclusiveMinimum === undefined ? "" : "over "}${low} to ${property.exclusiveMaximum === undefined ? "" : "under "}${high}` : words.join(", ");
  return {
    pointer, section, section_doc, only, doc, words, range, types, not_in: [.../Not in ((?:`\w+`(?:, | and )?)+)/.exec(doc)?.[1].matchAll(/`(\w+)`/g) ?? []].map(([, name]) => name),
    title: property.title ?? titleOf(pointer), unit: /Unit: ([^\s]+)\. /.exec(`${doc} `)?.[1] ?? "",
    preset: property.default === undefined ? "" : typeof property.default === "object" && property.default !== null ? JSON.stringify(property.default) : String(property.default ?? "none"),
  };
}

const titleOf = (pointer) => {
  const words = pointer.split("/").at(-1).replaceAll("_", " ");
  return words[0].toUpperCase() + words.slice(1);
};

export const isFor = (field, experiment) => (!field.only || field.only === experiment) && !field.not_in.includes(experiment);

/** Fields by section, in order: pairs of title, description and fields. */
export function sections(all) {
  const found = new Map();
  for (const field of all) {
    if (!found.has(field.section)) found.set(field.section, [field.section.slice(1).replaceAll("/", ", ").replaceAll("_", " ") || "general", field.section ? field.section_doc : "", []]);
    found.get(field.section)[2].push(field);
  }
  // What the experiment is about comes first, numerics and the seed last.
  const rank = ([title]) => (["equipment", "product"].includes(title) ? 0 : ["numerics", "general"].some((late) => title.startsWith(late)) ? 2 : 1);
  return [...found.values()].sort((a, b) => rank(a) - rank(b));
}

const nameOf = (factor) => factor.pointer ?? factor.pointers?.[0];
const told = (value) => (typeof value === "string" ? value : JSON.stringify(value));

/** The text that stands for a field in a sweep: its value, its levels or its range; nothing for the default. */
export function readField(sweep, { pointer }) {
  const factor = sweep.factors?.find((one) => nameOf(one) === pointer);
  if (factor) return factor.levels ? factor.levels.map(told).join(", ") : `${factor.low} .. ${factor.high}${factor.scale === "log" ? " log" : ""}${factor.count ? ` in ${factor.count}` : ""}`;
  const value = pointer.split("/").slice(1).reduce((inside, key) => inside?.[key], sweep.base);
  return value === undefined ? "" : told(value);
}

function value(text, { types, words }) {
  if (text === "true" || text === "false") return text === "true";
  if (text === "none" || text === "null") return null;
  if (words.includes(text)) return text;
  if (/^[[{"]/.test(text)) return JSON.parse(text);
  const number = Number(text);
  if (!Number.isNaN(number)) return number;
  if (types.includes("string")) return text;
  throw new Error(`“${text}” is no number`);
}

/** The sweep with that text in a field. Documents are never changed in place. */
export function writeField(sweep, field, text) {
  const factors = (sweep.factors ?? []).filter((one) => nameOf(one) !== field.pointer);
  const trimmed = text.trim();
  const range = /^(\S+)\s*(?:\.\.|…)\s*(\S+?)(\s+log)?(?:\s+in\s+(\d+))?$/.exec(trimmed);
  if (range) {
    const [low, high] = [Number(range[1]), Number(range[2])];
    if (Number.isNaN(low) || Number.isNaN(high)) throw new Error("a range is two numbers, such as 0.1 .. 0.4");
    const factor = { pointer: field.pointer, low, high, ...(range[3] && { scale: "log" }), ...(range[4] && { count: Number(range[4]) }) };
    return { ...sweep, base: without(sweep.base, field.pointer), factors: [...factors, factor] };
  }
  if (trimmed.includes(",") && !/^[[{]/.test(trimmed)) {
    const levels = trimmed.split(",").map((part) => part.trim()).filter(Boolean).map((part) => value(part, field));
    return { ...sweep, base: without(sweep.base, field.pointer), factors: [...factors, { pointer: field.pointer, levels }] };
  }
  const base = trimmed === "" ? without(sweep.base, field.pointer) : withValue(sweep.base, field.pointer.split("/").slice(1), value(trimmed, field));
  return { ...sweep, base, factors };
}

function withValue(inside, [key, ...rest], value) {
  return { ...inside, [key]: rest.length === 0 ? value : withValue(inside?.[key] ?? {}, rest, value) };
}

function without(inside, pointer) {
  const [key, ...rest] = pointer.split("/").slice(1);
  if (inside?.[key] === undefined) return inside;
  const { [key]: old, ...others } = inside;
  if (rest.length === 0) return others;
  const less = without(old, `/${rest.join("/")}`);
  return Object.keys(less).length === 0 ? others : { ...inside, [key]: less };
}
