// @ts-check
// Plots of single experiments, beside the plots of every sweep.

import { bendPlot } from "./bend.js";
import { compressPlot } from "./compress.js";
import { dropPlot } from "./drop.js";
import { slidePlot } from "./slide.js";

/**
 * @typedef {object} Form
 * @property {string[]} failures measures of failure, which the map shows unless another is chosen; the table of results does not mark them
 * @property {string} [title] of its own plot
 * @property {string} [over] the factor of its plot, where it varies
 * @property {string} [curve] the curve that its plot needs
 * @property {(input: PlotInput) => Plot} [plot] its own plot
 */

/**
 * Forms by experiment. An experiment without an entry has the plots of every sweep.
 * @type {Record<string, Form>}
 */
const FORMS = {
  hopper: { failures: ["jammed", "regime=no_flow", "regime=inconsistent"] },
  drop: { failures: [], title: "Bonds intact over impact speed", over: "/drop/speed_m_s", plot: dropPlot },
  bend: { failures: ["torn=true", "fell_off=true"], title: "Bend angle", over: "/bonds/normal_stiffness_n_m3", plot: bendPlot },
  slide: { failures: ["slid=true", "rolled_over=true"], title: "Angle of sliding over friction", over: "/contact/fillet_equipment/static_friction", plot: slidePlot },
  compress: { failures: [], title: "Stress over strain", curve: "stress", plot: compressPlot },
};

/**
 * The form of an experiment.
 * @param {string} experiment @returns {Form}
 */
export const formOf = (experiment) => FORMS[experiment] ?? { failures: [] };

/**
 * Names of the responses that the page of a large sweep reads: those of the headline, of the map, and the chosen ones.
 * @param {Form} form @param {string[]} headline @param {(string | null)[]} chosen measures
 */
export function responsesOf(form, headline, chosen) {
  const measures = [...form.failures, ...chosen.filter((name) => name !== null)];
  return [...new Set([...headline, ...measures.map((name) => name.split("=")[0])])].join(",");
}
