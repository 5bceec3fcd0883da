// @ts-check
// The document of a sweep and the fields of its form: descriptions from the schema, and text to values, levels or ranges and back.

/**
 * A field of the form.
 * @typedef {object} Field
 * @property {string} pointer
 * @property {string} section pointer of its section
 * @property {string} [section_doc]
 * @property {string[] | null} experiments that have it; null for all
 * @property {string} doc
 * @property {string[]} words its values, where it takes words
 * @property {string} range the allowed values in words
 * @property {(string | undefined)[]} types JSON types
 * @property {string} title
 * @property {string} unit
 * @property {string} preset the default
 */
/** @typedef {NonNullable<SweepSpec["factors"]>[number]} Factor */
/** @typedef {Record<string, unknown>} Json */

/**
 * All fields of the schema, section by section.
 * @param {Schema} schema @param {string} section @param {Field[]} found @param {string[] | null} experiments @returns {Field[]}
 */
export function fields(schema, section = "", found = [], experiments = null) {
  for (const [name, property] of Object.entries(schema.properties ?? {})) {
    const pointer = `${section}/${name}`, inside = property["x-experiments"] ?? experiments;
    if (property.type === "object" && property.properties && property.default === undefined) fields(property, pointer, found, inside);
    else found.push(field(pointer, property, section, schema.description, inside));
  }
  return found;
}

/**
 * @param {string} pointer @param {Schema} property @param {string} section @param {string | undefined} section_doc @param {string[] | null} experiments
 * @returns {Field}
 */
function field(pointer, property, section, section_doc, experiments) {
  const doc = property.description ?? "";
  const types = [property.type].flat();
  const words = property.enum ?? (types.includes("boolean") ? ["true", "false"] : []);
  const [low, high] = [property.minimum ?? property.exclusiveMinimum, property.maximum ?? property.exclusiveMaximum];
  const range = low !== undefined && high !== undefined ? `${property.exclusiveMinimum === undefined ? "" : "over "}${low} to ${property.exclusiveMaximum === undefined ? "" : "under "}${high}` : words.join(", ");
  const preset = property.default;
  return {
    pointer, section, section_doc, experiments, doc, words, range, types, title: property.title ?? titleOf(pointer), unit: property["x-unit"] ?? "",
    preset: preset === undefined ? "" : typeof preset === "object" && preset !== null ? JSON.stringify(preset) : String(preset ?? "none"),
  };
}

/** @param {string} pointer */
const titleOf = (pointer) => {
  const words = (pointer.split("/").at(-1) ?? "").replaceAll("_", " ");
  return words[0].toUpperCase() + words.slice(1);
};

/**
 * Whether an experiment has a field.
 * @param {Field} field @param {string} experiment
 */
export const isFor = (field, experiment) => field.experiments?.includes(experiment) ?? true;

/**
 * Fields by section: equipment and product first, numerics and general fields last.
 * @param {Field[]} all
 */
export function sections(all) {
  /** @type {Map<string, { title: string, doc: string | undefined, inside: Field[] }>} */
  const found = new Map();
  for (const field of all) {
    const section = found.get(field.section) ?? { title: field.section.slice(1).replaceAll("/", ", ").replaceAll("_", " ") || "general", doc: field.section ? field.section_doc : "", inside: [] };
    section.inside.push(field);
    found.set(field.section, section);
  }
  const rank = (/** @type {string} */ title) => (["equipment", "product"].includes(title) ? 0 : ["numerics", "general"].some((late) => title.startsWith(late)) ? 2 : 1);
  return [...found.values()].sort((a, b) => rank(a.title) - rank(b.title));
}

/**
 * The fields that a factor varies: one, or several that take the same value.
 * @param {Factor} factor @returns {string[]}
 */
export const pointersOf = (factor) => factor.pointers ?? (factor.pointer ? [factor.pointer] : []);

/** @param {SweepSpec} sweep @param {string} pointer */
const factorOf = (sweep, pointer) => sweep.factors?.find((one) => pointersOf(one).includes(pointer));

/**
 * The other fields that take the same value as this one.
 * @param {SweepSpec} sweep @param {string} pointer
 */
export const linkedTo = (sweep, pointer) => pointersOf(factorOf(sweep, pointer) ?? { pointers: [] }).filter((other) => other !== pointer);

/** @param {unknown} value */
const asText = (value) => (typeof value === "string" ? value : JSON.stringify(value));

/** @param {unknown} value @returns {value is Json} */
const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

/**
 * Why a form cannot show a document, or null. The server finds all other faults.
 * @param {unknown} sweep
 */
export function whyUnreadable(sweep) {
  if (!isObject(sweep)) return "it must be a JSON object";
  const wrong = ["base", "design"].find((name) => !isObject(sweep[name]));
  if (wrong) return `\`${wrong}\` must be a JSON object`;
  const isFactor = (/** @type {unknown} */ one) => isObject(one) && Array.isArray(one.pointers ?? []) && pointersOf(/** @type {Factor} */ (one)).every((pointer) => typeof pointer === "string") && Array.isArray(one.levels ?? []);
  const factors = sweep.factors ?? [];
  return Array.isArray(factors) && factors.every(isFactor) ? null : "`factors` must be a list of objects, each with `pointer` or `pointers`";
}

/**
 * The text of a field: its value, its levels or its range; empty for the default.
 * @param {SweepSpec} sweep @param {Pick<Field, "pointer">} field
 */
export function readField(sweep, { pointer }) {
  const factor = factorOf(sweep, pointer);
  if (factor && !factor.levels && (factor.low === undefined || factor.low === null)) return "";
  if (factor) return factor.levels ? factor.levels.map(asText).join(", ") : `${factor.low} .. ${factor.high}${factor.scale === "log" ? " log" : ""}${factor.count ? ` in ${factor.count}` : ""}`;
  const value = pointer.split("/").slice(1).reduce((/** @type {unknown} */ inside, key) => /** @type {Json | undefined} */ (inside)?.[key], sweep.base);
  return value === undefined ? "" : asText(value);
}

/** @param {string} text @param {Pick<Field, "types" | "words">} field @returns {unknown} */
function valueOf(text, { types, words }) {
  if (text === "true" || text === "false") return text === "true";
  if (text === "none" || text === "null") return null;
  if (words.includes(text)) return text;
  if (/^[[{"]/.test(text)) return JSON.parse(text);
  const number = Number(text);
  if (!Number.isNaN(number)) return number;
  if (types.includes("string")) return text;
  throw new Error(`“${text}” is not a number`);
}

/**
 * A copy of the sweep with this text in a field and in the fields that are linked to it.
 * @param {SweepSpec} sweep @param {Pick<Field, "pointer" | "types" | "words">} field @param {string} text @returns {SweepSpec}
 */
export function writeField(sweep, field, text) {
  const before = factorOf(sweep, field.pointer), pointers = before ? pointersOf(before) : [field.pointer];
  const trimmed = text.trim(), varied = rangeOf(trimmed) ?? levelsOf(trimmed, field);
  const factors = sweep.factors ?? [], base = pointers.reduce(without, sweep.base);
  if (varied) {
    const factor = /** @type {Factor} */ ({ ...(before?.pointers ? { pointers } : { pointer: field.pointer }), ...varied });
    return { ...sweep, base, factors: before ? factors.map((one) => (one === before ? factor : one)) : [...factors, factor] };
  }
  const fixed = (/** @type {Json} */ base, /** @type {string} */ pointer) => withValue(base, pointer.split("/").slice(1), valueOf(trimmed, field));
  return { ...sweep, base: trimmed === "" ? base : pointers.reduce(fixed, base), factors: factors.filter((one) => one !== before) };
}

/** @param {string} text */
function rangeOf(text) {
  const found = /^(\S+)\s*(?:\.\.|…)\s*(\S+?)(\s+log)?(?:\s+in\s+(\d+))?$/.exec(text);
  if (!found) return null;
  const [low, high] = [Number(found[1]), Number(found[2])];
  if (Number.isNaN(low) || Number.isNaN(high)) throw new Error("a range needs two numbers, such as 0.1 .. 0.4");
  return { low, high, ...(found[3] && { scale: "log" }), ...(found[4] && { count: Number(found[4]) }) };
}

/** @param {string} text @param {Pick<Field, "types" | "words">} field */
function levelsOf(text, field) {
  if (!text.includes(",") || /^[[{]/.test(text)) return null;
  return { levels: text.split(",").map((part) => part.trim()).filter(Boolean).map((part) => valueOf(part, field)) };
}

/** @param {Json | undefined} inside @param {string[]} path @param {unknown} value @returns {Json} */
function withValue(inside, [key, ...rest], value) {
  return { ...inside, [key]: rest.length === 0 ? value : withValue(/** @type {Json | undefined} */ (inside?.[key]), rest, value) };
}

/** @param {Json} inside @param {string} pointer @returns {Json} */
function without(inside, pointer) {
  const [key, ...rest] = pointer.split("/").slice(1);
  if (inside?.[key] === undefined) return inside;
  const { [key]: old, ...others } = inside;
  if (rest.length === 0) return others;
  const inner = without(/** @type {Json} */ (old), `/${rest.join("/")}`);
  return Object.keys(inner).length === 0 ? others : { ...inside, [key]: inner };
}
