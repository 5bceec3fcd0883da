// Submit a sweep: a form made from the schema of the scenario, over a document that can be seen and written as JSON too. Every change is
// validated by the server, which also says what it will cost.

import { maker, post, read } from "../api.js";
import { fill, h, prose } from "../dom.js";
import { duration, factor, many, number } from "../format.js";
import { action, asked, choice, facts, fault, remember } from "../parts.js";
import { fields, sections, isFor, linkedTo, pointersOf, readField, unreadable, writeField } from "../document.js";

const DRAFT = "draft of a sweep";
const DESIGNS = ["grid", "one_at_a_time", "random", "latin_hypercube", "sobol", "box_behnken"];
const DRAWN = ["random", "latin_hypercube", "sobol"];
const EMPTY = { name: "new sweep", base: { experiment: "hopper", numerics: { timestep_s: "auto" } }, design: { kind: "grid" }, factors: [], replicates: 1 };

/** The document of the sweep that is to be cloned, if one is; from then on it is the draft. */
async function cloned() {
  const id = asked("clone");
  if (!id) return null;
  const document = await read(`/v1/sweeps/${id}/spec`);
  remember({ clone: null });
  return document;
}

export async function show(main) {
  document.title = "Submit · Roost";
  const schema = await read("/v1/schema/scenario");
  const all = fields(schema);
  const draft = (await cloned()) ?? JSON.parse(sessionStorage.getItem(DRAFT) ?? "null");
  let sweep = unreadable(draft) ? EMPTY : draft;
  const made = maker("/v1/sweeps");
  const top = h("div"), form = h("div"), verdict = h("section", { class: "card", "aria-live": "polite" });
  const text = h("textarea", { spellcheck: "false", "aria-label": "The sweep as JSON", onchange: () => written() });
  main.append(h("h1", {}, "Submit a sweep"),
    h("p", { class: "dim" }, "Empty fields keep their default. To vary a field write several values, ", h("code", {}, "0.04, 0.05, 0.06"), ", or a range, ", h("code", {}, "0.1 .. 0.4"), "."),
    top, verdict, form, h("details", { class: "card" }, h("summary", {}, "As JSON"), text));

  function changed(to, { is_redrawn = false } = {}) {
    sweep = to;
    sessionStorage.setItem(DRAFT, JSON.stringify(sweep));
    text.value = JSON.stringify(sweep, null, 2);
    if (is_redrawn) draw();
    validate();
  }
  function written() {
    let to = null, trouble = null;
    try {
      to = JSON.parse(text.value);
      trouble = unreadable(to) && `This is no sweep: ${unreadable(to)}`;
    } catch (error) {
      trouble = `This is no JSON: ${error.message}`;
    }
    if (!trouble) return changed(to, { is_redrawn: true });
    unvalidated();
    fill(verdict, h("p", { class: "fault", role: "alert" }, trouble));
  }

  function drawTop() {
    const { kind } = sweep.design;
    const field = (label, value, attributes, take) => {
      const input = h("input", { value: value ?? "", ...attributes, onchange: () => take(input.value) });
      return h("label", { class: "field" }, label, input);
    };
    const whole = { type: "number", min: 1, step: 1, style: { width: "90px" } };
    const recorded = (every) => {
      const { frame_interval_s, ...rest } = sweep;
      changed(every === "" ? rest : { ...rest, frame_interval_s: Number(every) });
    };
    const design = (more) => changed({ ...sweep, design: { ...sweep.design, ...more } });
    fill(top, h("div", { class: "row card" },
      field("Name", sweep.name, { size: 30 }, (name) => changed({ ...sweep, name })),
      choice("Experiment", schema.properties.experiment.enum, sweep.base.experiment, (experiment) => changed({ ...sweep, base: { ...sweep.base, experiment } }, { is_redrawn: true })),
      choice("Design", [...new Set([...DESIGNS, kind])].map((kind) => [kind, kind.replaceAll("_", " ")]), kind, (kind) =>
        changed({ ...sweep, design: DRAWN.includes(kind) ? { kind, points: sweep.design.points ?? 16 } : { kind } }, { is_redrawn: true })),
      DRAWN.includes(kind) && field("Points", sweep.design.points, whole, (points) => design({ points: Number(points) })),
      DRAWN.includes(kind) && field("Seed of the design", sweep.design.seed ?? 1, whole, (seed) => design({ seed: Number(seed) })),
      field("Replicates", sweep.replicates, whole, (replicates) => changed({ ...sweep, replicates: Number(replicates) })),
      field("Frames every (s)", sweep.frame_interval_s, { type: "number", min: 0, step: "any", placeholder: "none", style: { width: "90px" } }, recorded),
      h("button", { type: "button", onclick: () => changed(EMPTY, { is_redrawn: true }) }, "Start anew")));
  }

  const inputs = new Map();
  function input(field) {
    const note = h("span", { class: "wrong" }), together = linkedTo(sweep, field.pointer);
    const list = field.words.length > 0 && h("datalist", { id: `words${field.pointer}` }, field.words.map((value) => h("option", { value })));
    const box = h("input", { value: readField(sweep, field), placeholder: field.preset, title: field.doc, autocomplete: "off", list: list ? `words${field.pointer}` : undefined,
      onchange: () => {
        try {
          const linked = linkedTo(sweep, field.pointer);
          changed(writeField(sweep, field, box.value));
          tell(field.pointer, null);
          for (const other of linked) if (inputs.has(other)) inputs.get(other).box.value = box.value;
        } catch (error) {
          tell(field.pointer, error.message);
        }
      } });
    inputs.set(field.pointer, { box, note });
    return h("label", { title: field.doc }, h("span", {}, field.title, field.unit && ` (${field.unit})`), box, list, h("span", {}, field.range), together.length > 0 && h("span", {}, `together with ${together.map((pointer) => factor(pointer)).join(", ")}`), note);
  }
  function tell(pointer, message) {
    const found = inputs.get(pointer);
    if (!found) return;
    found.note.textContent = message ?? "";
    if (message) found.box.setAttribute("aria-invalid", "true");
    else found.box.removeAttribute("aria-invalid");
  }
  function draw() {
    drawTop();
    inputs.clear();
    const { experiment } = sweep.base;
    const shown = all.filter((field) => isFor(field, experiment) && field.pointer !== "/experiment" && field.pointer !== "/schema");
    fill(form, sections(shown).map(([title, doc, inside], i) => h("details", { class: "card", open: i < 2 || inside.some((field) => readField(sweep, field) !== "") },
      h("summary", {}, title), doc && h("p", { class: "dim" }, prose(doc)), h("div", { class: "form" }, inside.map(input)))));
  }

  let timer = null, sent = 0;
  /** What was said of an earlier document counts no more. */
  function unvalidated() {
    clearTimeout(timer);
    return ++sent;
  }
  function validate() {
    const number = unvalidated();
    timer = setTimeout(async () => {
      const answer = await post("/v1/validate", sweep).catch((error) => error);
      if (number !== sent) return;
      for (const pointer of inputs.keys()) tell(pointer, null);
      if (answer instanceof Error) refused(answer);
      else accepted(answer);
    }, 400);
  }
  function refused(error) {
    fill(verdict, fault(error));
    for (const one of error.errors ?? []) {
      const [, i] = /^\/factors\/(\d+)/.exec(one.pointer) ?? [];
      const pointer = i === undefined ? one.pointer.replace(/^\/base/, "") : pointersOf(sweep.factors?.[i] ?? {})[0];
      tell(pointer, one.detail);
    }
  }
  function accepted({ jobs, estimate, wall_s }) {
    const submit = action(`Submit ${many(jobs, "job")}`, async () => {
      const { id } = await made(sweep);
      sessionStorage.removeItem(DRAFT);
      location.href = `/sweeps/${id}`;
    }, { is_main: true });
    fill(verdict, h("div", { class: "row spread" }, facts([["Jobs", jobs.toLocaleString("en")], ["Sub-particles of the base", number(estimate.subparticles)], ["Steps", number(estimate.steps)],
      ["Memory", `${number(estimate.memory_bytes / 2 ** 20, 3)} MiB`], ["A job", duration(estimate.wall_s)], ["All, one after the other", duration(wall_s)]]), submit),
      estimate.warnings.map((warning) => h("p", {}, warning)));
  }
  changed(sweep, { is_redrawn: true });
}
