// The experiments in forms of their own. Which one a sweep is of shows in its responses: each has one that no other has.

import { bendPlot } from "./bend.js";
import { compressPlot } from "./compress.js";
import { dropPlot } from "./drop.js";
import { slidePlot } from "./slide.js";

/**
 * By a response that tells them: what is asked of them first (`measures`), what may go wrong (`faults`), their `series`, and, but for the hopper, whose
 * curves and maps the page has anyway, a plot: its `title`, the factor that it is drawn over if that varies (`over`), `plot`, and a `curve` that it needs.
 */
const FORMS = {
  settle_time_s: {
    measures: ["bonds_intact_fraction", "settle_time_s", "lowest_bonds_intact_fraction"], faults: ["bonds_intact_fraction"], series: ["bonds_intact_fraction", "kinetic_energy", "plate_force"],
    title: "Bonds intact over the speed of impact", over: "/drop/speed_m_s", plot: dropPlot,
  },
  bend_angle_deg: {
    measures: ["bend_angle_deg", "largest_bend_angle_deg", "time_to_rest_s"], faults: ["torn=true", "fell_off=true"], series: ["bend_angle", "tip_deflection", "kinetic_energy", "bonds_intact_fraction"],
    title: "How far it bends", over: "/bonds/normal_stiffness_n_m3", plot: bendPlot,
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
const OTHER = { measures: ["greatest_height_m", "time_to_rest_s"], faults: [], series: ["kinetic_energy", "bonds_intact_fraction"] };

/** The form of a sweep with these design points. */
export function formOf(points) {
  const row = points.find((one) => Object.keys(one.responses).length > 0);
  const told = row && Object.keys(FORMS).find((name) => name in row.responses);
  return told ? FORMS[told] : OTHER;
}

/** Responses that forms ask of large sweeps, and the chosen ones. */
export function responsesOf(chosen) {
  const asked = Object.values(FORMS).flatMap((form) => [...form.measures, ...form.faults]);
  const names = [...Object.keys(FORMS), ...asked, ...OTHER.measures, ...chosen.filter(Boolean), "friction_angle_deg"].map((name) => name.split("=")[0]);
  return [...new Set(names)].join(",");
}
