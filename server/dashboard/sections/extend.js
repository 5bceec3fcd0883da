// More of a sweep: what failed runs again, by class if wanted; more points, levels or replicates.

import { h, say } from "../dom.js";
import { factor } from "../format.js";
import { CLASSES, fault } from "../parts.js";

const BY_POINTS = ["random", "sobol"];
const BY_LEVELS = ["grid", "one_at_a_time"];

/** A button that opens a form. `opened()` gives what gets its data, and whoever refuses says why in it. */
function dialog(title, inside, opened) {
  const trouble = h("div");
  let submit = null;
  const send = async (event) => {
    event.preventDefault();
    try {
      await submit(new FormData(form));
      element.close();
      say(`${title}: done`);
    } catch (error) {
      trouble.replaceChildren(fault(error));
    }
  };
  const form = h("form", { onsubmit: send }, h("h2", {}, title), inside, trouble,
    h("div", { class: "row" }, h("button", { class: "main" }, title), h("button", { type: "button", onclick: () => element.close() }, "Back")));
  const element = h("dialog", { "aria-label": title }, form);
  return [h("button", { type: "button", onclick: () => (trouble.replaceChildren(), (submit = opened()), element.showModal()) }, title), element];
}

/** Runs again what failed or was cancelled, which `count()` counts; `post` gets the query. */
export function retry(count, post) {
  const all = h("option", { value: "" });
  const inside = h("label", { class: "field" }, "Which",
    h("select", { name: "class" }, all, CLASSES.map((name) => h("option", { value: name }, `failed: ${name}`))));
  return dialog("Retry", inside, () => {
    all.textContent = `all ${count().toLocaleString("en")} that failed or were cancelled`;
    return (data) => post(data.get("class") ? `?class=${data.get("class")}` : "");
  });
}

/** Adds to a sweep what its design can take; `opened()` gives what gets the request. */
export function extend(sweep, opened) {
  const field = (name, label, attributes) => h("p", {}, h("label", { class: "field" }, label, h("input", { name, ...attributes })));
  const whole = { type: "number", min: 1, step: 1 };
  const inside = [
    BY_POINTS.includes(sweep.design) && field("points", "More points of the same sequence", whole),
    BY_LEVELS.includes(sweep.design) && sweep.factors.map((pointer) => field(pointer, `More levels of ${factor(pointer, sweep.factors)}`, { placeholder: "with commas between" })),
    field("replicates", "More replicates of every point", whole),
  ];
  return dialog("Extend", inside, () => {
    const post = opened();
    return (data) => post(request(sweep, data));
  });
}

function request(sweep, data) {
  const whole = (name) => (data.get(name) ? { [name]: Number(data.get(name)) } : {});
  const read = (text) => text.split(",").map((part) => part.trim()).filter(Boolean).map((part) => (Number.isNaN(Number(part)) ? part : Number(part)));
  const levels = Object.fromEntries(sweep.factors.map((pointer) => [pointer, read(data.get(pointer) ?? "")]).filter(([, values]) => values.length > 0));
  return { ...whole("points"), ...whole("replicates"), ...(Object.keys(levels).length > 0 && { levels }) };
}
