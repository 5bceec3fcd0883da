// @ts-check
// A button with a dialog, and the dialogs that retry failed jobs and extend a sweep by points, levels or replicates.

import { h, announce } from "../dom.js";
import { factorLabel } from "../format.js";
import { FAILURE_CLASSES, errorBox } from "../parts.js";

const BY_POINTS = ["random", "sobol"];
const BY_LEVELS = ["grid", "one_at_a_time"];

/**
 * A button and its dialog with a form. `open` prepares one use and returns the function that sends the data; an error shows in the form.
 * @param {string} title @param {Child} inside @param {() => (data: FormData) => Promise<unknown>} open
 * @returns {[HTMLButtonElement, HTMLDialogElement]}
 */
export function dialog(title, inside, open) {
  const errors = h("div");
  /** @type {((data: FormData) => Promise<unknown>) | undefined} */
  let submit;
  const send = async (/** @type {Event} */ event) => {
    event.preventDefault();
    try {
      await submit?.(new FormData(form));
      element.close();
      announce(`${title}: done`);
    } catch (error) {
      errors.replaceChildren(errorBox(/** @type {Error} */ (error)));
    }
  };
  const form = h("form", { onsubmit: send }, h("h2", {}, title), inside, errors,
    h("div", { class: "row" }, h("button", { class: "main" }, title), h("button", { type: "button", onclick: () => void element.close() }, "Close")));
  const element = h("dialog", { "aria-label": title }, form);
  const show = () => {
    errors.replaceChildren();
    submit = open();
    element.showModal();
  };
  return [h("button", { type: "button", onclick: show }, title), element];
}

/**
 * The dialog that retries failed and cancelled jobs.
 * @param {() => number} count of these jobs @param {(query: string) => Promise<unknown>} post
 */
export function retry(count, post) {
  const all = h("option", { value: "" });
  const inside = h("label", { class: "field" }, "Jobs",
    h("select", { name: "class" }, all, FAILURE_CLASSES.map((name) => h("option", { value: name }, `failed: ${name}`))));
  return dialog("Retry", inside, () => {
    all.textContent = `all ${count().toLocaleString("en")} failed or cancelled`;
    return (data) => post(data.get("class") ? `?class=${data.get("class")}` : "");
  });
}

/**
 * The dialog that extends a sweep as its design allows. `open` returns the function that sends one request.
 * @param {SweepView} sweep @param {() => (request: object) => Promise<unknown>} open
 */
export function extend(sweep, open) {
  const field = (/** @type {string} */ name, /** @type {string} */ label, /** @type {Attributes} */ attributes) => h("p", {}, h("label", { class: "field" }, label, h("input", { name, ...attributes })));
  const whole = { type: "number", min: 1, step: 1 };
  const inside = [
    BY_POINTS.includes(sweep.design) && field("points", "More points of the same sequence", whole),
    BY_LEVELS.includes(sweep.design) && sweep.factors.map((pointer) => field(pointer, `More levels of ${factorLabel(pointer, sweep.factors)}`, { placeholder: "separate with commas" })),
    field("replicates", "More replicates of every point", whole),
  ];
  return dialog("Extend", inside, () => {
    const post = open();
    return (data) => post(request(sweep, data));
  });
}

/** @param {SweepView} sweep @param {FormData} data */
function request(sweep, data) {
  const whole = (/** @type {string} */ name) => (data.get(name) ? { [name]: Number(data.get(name)) } : {});
  const read = (/** @type {string} */ text) => text.split(",").map((part) => part.trim()).filter(Boolean).map((part) => (Number.isNaN(Number(part)) ? part : Number(part)));
  const levels = Object.fromEntries(sweep.factors.map((pointer) => /** @type {const} */ ([pointer, read(String(data.get(pointer) ?? ""))])).filter(([, values]) => values.length > 0));
  return { ...whole("points"), ...whole("replicates"), ...(Object.keys(levels).length > 0 && { levels }) };
}
