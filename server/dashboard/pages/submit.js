// @ts-check
// Submission of a sweep: a form made from the schema of scenarios, and the same document as JSON. The server validates every change and
// estimates the cost.

import { idempotentPost, post, read } from "../api.js";
import { fill, h, withCode } from "../dom.js";
import { duration, factorLabel, plural, number } from "../format.js";
import { publishedValues, readLibrary } from "../library.js";
import { action, choice, errorBox, facts, parameter, setParameters } from "../parts.js";
import { readSchema } from "../schema.js";
import { fields, sections, isFor, linkedTo, pointersOf, readField, whyUnreadable, writeField } from "../document.js";
import { costFacts } from "../sections/forecast.js";

/** Key of session storage. */
const DRAFT = "draft of a sweep";
const DESIGNS = ["grid", "one_at_a_time", "random", "latin_hypercube", "sobol", "box_behnken"];
const DRAWN = ["random", "latin_hypercube", "sobol"];
/** @type {SweepSpec} */
const EMPTY = { name: "new sweep", base: { experiment: "hopper", numerics: { timestep_s: "auto" } }, design: { kind: "grid" }, factors: [], replicates: 1 };

/** The document of the sweep to clone, if the address names one. */
async function cloned() {
  const id = parameter("clone");
  if (!id) return null;
  const document = await read(`/v1/sweeps/${id}/spec`);
  setParameters({ clone: null });
  // The form knows the defaults of the present schema only: a base that names its schema is written out in full.
  if (document.base?.schema) document.base = (await post("/v1/validate", document)).scenario;
  return document;
}

/** @param {HTMLElement} main */
export async function show(main) {
  document.title = "Submit · Roost";
  const [schema, library] = await Promise.all([readSchema(), readLibrary()]);
  const all = fields(schema);
  const draft = (await cloned()) ?? JSON.parse(sessionStorage.getItem(DRAFT) ?? "null");
  /** @type {SweepSpec} */
  let sweep = whyUnreadable(draft) ? EMPTY : draft;
  const submitSweep = idempotentPost("/v1/sweeps");
  const top = h("div"), form = h("div"), verdict = h("section", { class: "card", "aria-live": "polite" });
  const text = h("textarea", { spellcheck: "false", "aria-label": "The sweep as JSON", onchange: () => void readJson() });
  main.append(h("h1", {}, "Submit a sweep"),
    h("p", { class: "dim" }, "An empty field has its default value. To vary a field, enter several values, ", h("code", {}, "0.04, 0.05, 0.06"), ", or a range, ", h("code", {}, "0.1 .. 0.4"), "."),
    top, verdict, form, h("details", { class: "card" }, h("summary", {}, "As JSON"), text));

  /** @param {SweepSpec} to @param {{ is_redrawn?: boolean }} [options] */
  function changed(to, { is_redrawn = false } = {}) {
    sweep = to;
    sessionStorage.setItem(DRAFT, JSON.stringify(sweep));
    text.value = JSON.stringify(sweep, null, 2);
    if (is_redrawn) draw();
    validate();
  }
  function readJson() {
    let to, message;
    try {
      to = JSON.parse(text.value);
      message = whyUnreadable(to) && `This is not a sweep: ${whyUnreadable(to)}.`;
    } catch (error) {
      message = `This is not valid JSON: ${/** @type {Error} */ (error).message}`;
    }
    if (!message) return changed(to, { is_redrawn: true });
    cancelValidation();
    fill(verdict, h("p", { class: "fault", role: "alert" }, message));
  }

  function drawTop() {
    const { kind } = sweep.design;
    /** @param {string} label @param {string | number | null | undefined} value @param {Attributes} attributes @param {(text: string) => void} take */
    const field = (label, value, attributes, take) => {
      const input = h("input", { value: value ?? "", ...attributes, onchange: () => void take(input.value) });
      return h("label", { class: "field" }, label, input);
    };
    const whole = { type: "number", min: 1, step: 1, style: { width: "90px" } };
    const setFrameInterval = (/** @type {string} */ interval) => {
      const { frame_interval_s, ...rest } = sweep;
      changed(interval === "" ? rest : { ...rest, frame_interval_s: Number(interval) });
    };
    const design = (/** @type {Partial<SweepSpec["design"]>} */ more) => changed({ ...sweep, design: { ...sweep.design, ...more } });
    fill(top, h("div", { class: "row card" },
      field("Name", sweep.name, { size: 30 }, (name) => changed({ ...sweep, name })),
      choice("Experiment", schema.properties?.experiment.enum ?? [], experimentOf(sweep), (experiment) => changed({ ...sweep, base: { ...sweep.base, experiment } }, { is_redrawn: true })),
      choice("Design", [...new Set([...DESIGNS, kind])].map((kind) => /** @type {Option} */ ([kind, kind.replaceAll("_", " ")])), kind, (text) => {
        const kind = /** @type {SweepSpec["design"]["kind"]} */ (text);
        changed({ ...sweep, design: DRAWN.includes(kind) ? { kind, points: sweep.design.points ?? 16 } : { kind } }, { is_redrawn: true });
      }),
      DRAWN.includes(kind) && field("Points", sweep.design.points, whole, (points) => design({ points: Number(points) })),
      DRAWN.includes(kind) && field("Seed of the design", sweep.design.seed ?? 1, whole, (seed) => design({ seed: Number(seed) })),
      field("Replicates", sweep.replicates, whole, (replicates) => changed({ ...sweep, replicates: Number(replicates) })),
      field("Frames every (s)", sweep.frame_interval_s, { type: "number", min: 0, step: "any", placeholder: "none", style: { width: "90px" } }, setFrameInterval),
      h("button", { type: "button", onclick: () => changed(EMPTY, { is_redrawn: true }) }, "Reset")));
  }

  /** @type {Map<string, { box: HTMLInputElement, note: HTMLElement }>} */
  const inputs = new Map();
  /** @param {import("../document.js").Field} field */
  function input(field) {
    const note = h("span", { class: "wrong" }), linked = linkedTo(sweep, field.pointer);
    const list = field.words.length > 0 && h("datalist", { id: `words${field.pointer}` }, field.words.map((value) => h("option", { value })));
    const box = h("input", { value: readField(sweep, field), placeholder: field.preset, title: field.doc, autocomplete: "off", list: list ? `words${field.pointer}` : undefined,
      onchange: () => {
        try {
          const linked = linkedTo(sweep, field.pointer);
          changed(writeField(sweep, field, box.value));
          setError(field.pointer, null);
          for (const other of linked) {
            const twin = inputs.get(other);
            if (twin) twin.box.value = box.value;
          }
        } catch (error) {
          setError(field.pointer, /** @type {Error} */ (error).message);
        }
      } });
    inputs.set(field.pointer, { box, note });
    return h("div", {}, h("label", { title: field.doc }, h("span", {}, field.title, field.unit && ` (${field.unit})`), box, list, h("span", {}, field.range), linked.length > 0 && h("span", {}, `same value as ${linked.map((pointer) => factorLabel(pointer)).join(", ")}`), note), publishedValues(library, field.pointer));
  }
  /** @param {string} pointer @param {string | null} message */
  function setError(pointer, message) {
    const found = inputs.get(pointer);
    if (!found) return;
    found.note.textContent = message ?? "";
    if (message) found.box.setAttribute("aria-invalid", "true");
    else found.box.removeAttribute("aria-invalid");
  }
  function draw() {
    drawTop();
    inputs.clear();
    const experiment = experimentOf(sweep);
    const shown = all.filter((field) => isFor(field, experiment) && field.pointer !== "/experiment" && field.pointer !== "/schema");
    fill(form, sections(shown).map(({ title, doc, inside }, i) => h("details", { class: "card", open: i < 2 || inside.some((field) => readField(sweep, field) !== "") },
      h("summary", {}, title), doc && h("p", { class: "dim" }, withCode(doc)), h("div", { class: "form" }, inside.map(input)))));
  }

  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  let sent = 0;
  /** Discards the answer about an earlier document. */
  function cancelValidation() {
    clearTimeout(timer);
    return ++sent;
  }
  function validate() {
    const request = cancelValidation();
    timer = setTimeout(async () => {
      const answer = await post("/v1/validate", sweep).catch((error) => error);
      if (request !== sent) return;
      for (const pointer of inputs.keys()) setError(pointer, null);
      if (answer instanceof Error) showErrors(answer);
      else showEstimate(answer);
    }, 400);
  }
  /** @param {Error & { errors?: Fault[] }} error */
  function showErrors(error) {
    fill(verdict, errorBox(error));
    for (const one of error.errors ?? []) {
      const [, i] = /^\/factors\/(\d+)/.exec(one.pointer) ?? [];
      const pointer = i === undefined ? one.pointer.replace(/^\/base/, "") : pointersOf(sweep.factors?.[Number(i)] ?? {})[0];
      if (pointer) setError(pointer, one.detail);
    }
  }
  /** @param {ValidationReport} report */
  function showEstimate({ jobs, estimate, wall_s, forecast }) {
    const submit = action(`Submit ${plural(jobs, "job")}`, async () => {
      const { id } = await submitSweep(sweep);
      sessionStorage.removeItem(DRAFT);
      location.href = `/sweeps/${id}`;
    }, { is_main: true });
    fill(verdict, h("div", { class: "row spread" }, facts([["Jobs", jobs.toLocaleString("en")], ["Sub-particles per job", number(estimate.subparticles)], ["Steps", number(estimate.steps)],
      ["Memory", `${number(estimate.memory_bytes / 2 ** 20, 3)} MiB`], ["Time per job", duration(estimate.wall_s)], ["Time of all jobs, one after another", duration(wall_s)], ...(forecast ? costFacts(forecast) : [])]), submit),
      estimate.warnings.map((warning) => h("p", {}, warning)));
  }
  changed(sweep, { is_redrawn: true });
}

/** @param {SweepSpec} sweep */
const experimentOf = (sweep) => String(sweep.base.experiment);
