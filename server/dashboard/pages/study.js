// @ts-check
// One study: question, answer in words and as pictures, runs, and actions.

import { joinViews, poll, read, runLatest } from "../api.js";
import { fill, h } from "../dom.js";
import { readOutputs } from "../outputs.js";
import { errorBox } from "../parts.js";
import { pictures } from "../plots/studies/pictures.js";
import { studyHead } from "../sections/study.js";

/** Time between two looks at the study. */
const INTERVAL_S = 2;

/** @param {HTMLElement} main @param {string} id */
export async function show(main, id) {
  const at = `/v1/studies/${id}`;
  /** @type {[StudyAnswer, OutputTable]} */
  const [first, outputs] = await Promise.all([read(`${at}/answer`), readOutputs()]);
  const errors = h("div"), failed = (/** @type {any} */ error) => fill(errors, error ? errorBox(error) : []);
  const shown = pictures(first, outputs);
  const views = joinViews(update), head = studyHead(at, first, views.answer);
  main.append(h("div", { class: "row spread" }, h("h1", {}, first.study.name), head.bar), errors, head.runs, head.words, shown.element);

  const drawAnswer = runLatest(async () => {
    /** @type {StudyAnswer} */
    const { answer, factors } = await read(`${at}/answer`);
    head.setFactors(factors);
    await shown.draw(answer);
  }, failed);
  /** @param {StudyView} study */
  function update(study) {
    head.draw(study);
    // The answer with its map is long: it is read again when there is a newer one.
    drawAnswer(study.answered_at ?? "none");
  }
  update(first.study);
  poll(at, INTERVAL_S, views.arrive, failed);
}
