// @ts-check
// The pictures of a study's answer. They follow from its goal; each has a card.

import { h } from "../../dom.js";
import { factorLabel } from "../../format.js";
import { pointersOf } from "../../document.js";
import { boundaryPictures } from "./boundary.js";
import { calibratePictures } from "./calibrate.js";
import { estimatePictures } from "./estimate.js";
import { axisLabel, measureLabel } from "./labels.js";
import { optimisePictures } from "./optimise.js";
import { sensitivityPictures } from "./sensitivity.js";

/**
 * A picture: its card, and a function that draws a finding.
 * @typedef {{ card: HTMLElement, draw: (finding: any) => unknown }} Picture
 */
/** @typedef {{ goal: any, factors: StudyFactor[], label: (of: StudyMeasure) => string, axisLabel: (name: string) => string }} PictureInput */

/** @type {Record<string, (input: PictureInput) => Picture[]>} */
const BY_GOAL = { estimate: estimatePictures, boundary: boundaryPictures, optimise: optimisePictures, sensitivity: sensitivityPictures, calibrate: calibratePictures };

/**
 * The pictures of a study; `draw` gets the numbers of its answer, null before the first.
 * @param {StudyAnswer} study @param {OutputTable} outputs
 */
export function pictures({ factors, goal }, outputs) {
  const pointers = factors.map((factor) => pointersOf(factor)[0]);
  const described = factors.map((factor, i) => ({ pointer: pointers[i], label: factorLabel(pointers[i], pointers), low: factor.low ?? 0, high: factor.high ?? 1, is_log: factor.scale === "log", levels: /** @type {StudyValue[] | null} */ (factor.levels ?? null) }));
  const [[name, fields]] = Object.entries(goal);
  const all = BY_GOAL[name]?.({ goal: fields, factors: described, label: (of) => measureLabel(of, outputs), axisLabel: (name) => axisLabel(name, outputs) }) ?? [];
  return {
    element: h("div", { class: "grid" }, all.map((one) => one.card)),
    draw: (/** @type {any} */ answer) => {
      const finding = answer?.finding?.[name];
      return Promise.all(finding ? all.map((one) => one.draw(finding)) : []);
    },
  };
}
