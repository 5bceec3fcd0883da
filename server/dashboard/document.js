// A sweep's document and the fields of its form: what the schema says of each field, and how text becomes a value, levels or a range.

/** All fields of the schema, section by section. */
export function fields(schema, at = "", found = [], experiments = null) {
  for (const [name, property] of Object.entries(schema.properties)) {
    const pointer = `${at}/${name}`;
    const here = property["x-experiments"] ?? experiments;
    if (property.type === "object" && property.properties && property.default === undefined) {
      fields(property, pointer, found, here);
      continue;
    }
    found.push(field(pointer, property, { section: at, section_doc: schema.description, experiments: here }));
  }
  return found;
}

function field(pointer, property, { section, section_doc, experiments }) {
  const doc = property.description ?? "";
  const types = [property.type].flat();
  const words = property.enum ?? (types.includes("boolean") ? ["true", "false"] : []);
  const [low, high] = [property.minimum ?? property.exclusiveMinimum, property.maximum ?? property.exclusiveMaximum];
  const range = low !== undefined && high !== undefined ? `${property.exclusiveMinimum === undefined ? "" : "over "}${low} to ${property.exclusiveMaximum === undefined ? "" : "under "}${high}` : words.join(", ");
  return {
    pointer, section, section_doc, experiments, doc, words, range, types,
    title: property.title ?? titleOf(pointer), unit: /Unit: ([^\s]+)\. /.exec(`${doc} `)?.[1] ?? "",
    preset: property.default === undefined ? "" : typeof property.default === "object" && property.default !== null ? JSON.stringify(property.default) : String(property.default ?? "none"),
  };
}

const titleOf = (pointer) => {
  const words = pointer.split("/").at(-1).replaceAll("_", " ");
  return words[0].toUpperCase() + words.slice(1);
};

export const isFor = (field, experiment) => field.experiments?.includes(experiment) ?? true;

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

/** The fields that a factor varies: one, or several that take the same value. */
export const pointersOf = (factor) => factor.pointers ?? [factor.pointer];
const factorOf = (sweep, pointer) => sweep.factors?.find((one) => pointersOf(one).includes(pointer));

/** The other fields that take the same value as this one. */
export const linkedTo = (sweep, pointer) => pointersOf(factorOf(sweep, pointer) ?? { pointers: [] }).filter((other) => other !== pointer);
const told = (value) => (typeof value === "string" ? value : JSON.stringify(value));

const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

/** Why a form cannot show a document, if it cannot. What else is wrong with it the server says. */
export function unreadable(sweep) {
  if (!isObject(sweep)) return "a sweep is an object";
  const odd = ["base", "design"].find((name) => !isObject(sweep[name]));
  if (odd) return `its ${odd} is to be an object`;
  const isFactor = (one) => isObject(one) && Array.isArray(one.pointers ?? []) && pointersOf(one).every((pointer) => typeof pointer === "string") && Array.isArray(one.levels ?? []);
  if (Array.isArray(sweep.factors ?? []) && (sweep.factors ?? []).every(isFactor)) return null;
  return "its factors are to be a list of objects, each with a pointer or several pointers";
}

/** The text that stands for a field in a sweep: its value, its levels or its range; nothing for the default. */
export function readField(sweep, { pointer }) {
  const factor = factorOf(sweep, pointer);
  if (factor && !factor.levels && factor.low === undefined) return "";
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

/** The sweep with that text in a field, and in those that are linked to it. Documents are never changed in place. */
export function writeField(sweep, field, text) {
  const before = factorOf(sweep, field.pointer), pointers = before ? pointersOf(before) : [field.pointer];
  const trimmed = text.trim(), varied = range(trimmed) ?? levels(trimmed, field);
  const factors = sweep.factors ?? [], base = pointers.reduce(without, sweep.base);
  if (varied) {
    const factor = { ...(before?.pointers ? { pointers } : { pointer: field.pointer }), ...varied };
    return { ...sweep, base, factors: before ? factors.map((one) => (one === before ? factor : one)) : [...factors, factor] };
  }
  const fixed = (base, pointer) => withValue(base, pointer.split("/").slice(1), value(trimmed, field));
  return { ...sweep, base: trimmed === "" ? base : pointers.reduce(fixed, base), factors: factors.filter((one) => one !== before) };
}

function range(text) {
  const found = /^(\S+)\s*(?:\.\.|…)\s*(\S+?)(\s+log)?(?:\s+in\s+(\d+))?$/.exec(text);
  if (!found) return null;
  const [low, high] = [Number(found[1]), Number(found[2])];
  if (Number.isNaN(low) || Number.isNaN(high)) throw new Error("a range is two numbers, such as 0.1 .. 0.4");
  return { low, high, ...(found[3] && { scale: "log" }), ...(found[4] && { count: Number(found[4]) }) };
}

function levels(text, field) {
  if (!text.includes(",") || /^[[{]/.test(text)) return null;
  return { levels: text.split(",").map((part) => part.trim()).filter(Boolean).map((part) => value(part, field)) };
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
