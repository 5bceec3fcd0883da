// @ts-check
// What the page of a sweep shows for each experiment. The experiment follows from a response that only it has.

import { bendPlot } from "./bend.js";
import { compressPlot } from "./compress.js";
import { dropPlot } from "./drop.js";
import { slidePlot } from "./slide.js";

/**
 * @typedef {object} Form
 * @property {string[]} measures in the order in which the page offers them
 * @property {string[]} faults measures of failure, for the map
 * @property {string[]} series
 * @property {string} [title] of its own plot
 * @property {string} [over] the factor of its plot, where it varies
 * @property {string} [curve] the curve that its plot needs
 * @property {(input: PlotInput) => Plot} [plot] its own plot; the hopper needs none beside those of every sweep
 */

/**
 * Forms by the response that identifies their experiment.
 * @type {Record<string, Form>}
 */
const FORMS = {
  settle_time_s: {
    measures: ["bonds_intact_fraction", "settle_time_s", "lowest_bonds_intact_fraction"], faults: ["bonds_intact_fraction"], series: ["bonds_intact_fraction", "kinetic_energy", "plate_force"],
    title: "Bonds intact over impact speed", over: "/drop/speed_m_s", plot: dropPlot,
  },
  bend_angle_deg: {
    measures: ["bend_angle_deg", "largest_bend_angle_deg", "time_to_rest_s"], faults: ["torn=true", "fell_off=true"], series: ["bend_angle", "tip_deflection", "kinetic_energy", "bonds_intact_fraction"],
    title: "Bend angle", over: "/bonds/normal_stiffness_n_m3", plot: bendPlot,
  },
  critical_angle_deg: {
    measures: ["critical_angle_deg"], faults: ["slid=true", "rolled_over=true"], series: ["sliding_speed", "displacement", "tilt_angle", "kinetic_energy", "bonds_intact_fraction"],
    title: "Angle of sliding over friction", over: "/contact/fillet_equipment/static_friction", plot: slidePlot,
  },
  modulus_pa: {
    measures: ["modulus_pa", "modulus_lattice_pa", "stress_at_end_pa"], faults: ["modulus_pa"], series: ["lower_plate_force", "upper_plate_force", "kinetic_energy", "bonds_intact_fraction"],
    title: "Stress over strain", curve: "stress", plot: compressPlot,
  },
  discharged_kg: {
    measures: ["effective_throughput_kg_s", "mean_rate_kg_s", "discharged_kg"], faults: ["regime=no_flow", "regime=inconsistent"],
    series: ["discharged_mass", "mass_rate", "bonds_intact_fraction", "kinetic_energy"],
  },
};
/** @type {Form} */
const OTHER = { measures: ["greatest_height_m", "time_to_rest_s"], faults: [], series: ["kinetic_energy", "bonds_intact_fraction"] };

/**
 * The form of a sweep with these design points.
 * @param {PointRow[]} points
 */
export function formOf(points) {
  const row = points.find((one) => Object.keys(one.responses).length > 0);
  const response = row && Object.keys(FORMS).find((name) => name in row.responses);
  return response ? FORMS[response] : OTHER;
}

/**
 * Names of the responses that forms need, and of the chosen ones: a large sweep is read without its other responses.
 * @param {(string | null)[]} chosen
 */
export function responsesOf(chosen) {
  const needed = Object.values(FORMS).flatMap((form) => [...form.measures, ...form.faults]);
  const names = [...Object.keys(FORMS), ...needed, ...OTHER.measures, ...chosen.filter((name) => name !== null), "friction_angle_deg"].map((name) => name.split("=")[0]);
  return [...new Set(names)].join(",");
}
