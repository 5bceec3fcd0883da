// Plots of single experiments, beside those that every sweep has.

import { bendPlot } from "./bend.js";
import { compressPlot } from "./compress.js";
import { dropPlot } from "./drop.js";
import { slidePlot } from "./slide.js";

/**
 * By experiment: the responses that its map shows first (`map`), and a plot: its `title`, the factor that it is drawn over if that varies (`over`), `plot`, and
 * a `curve` that it needs. The hopper has the curves and maps of the page.
 */
const FORMS = {
  hopper: { map: ["regime=no_flow", "regime=inconsistent"] },
  drop: { map: [], title: "Bonds intact over the speed of impact", over: "/drop/speed_m_s", plot: dropPlot },
  bend: { map: ["torn=true", "fell_off=true"], title: "How far it bends", over: "/bonds/normal_stiffness_n_m3", plot: bendPlot },
  slide: { map: ["slid=true", "rolled_over=true"], title: "Angle of sliding over friction", over: "/contact/fillet_equipment/static_friction", plot: slidePlot },
  compress: { map: [], title: "Stress over strain", curve: "stress", plot: compressPlot },
};

/** The form of an experiment. */
export const formOf = (experiment) => FORMS[experiment] ?? { map: [] };

/** Responses that are read of large sweeps: the headline, those of the map, and the chosen ones. */
export function responsesOf(form, headline, chosen) {
  const names = [...headline, ...form.map, ...chosen.filter(Boolean)].map((name) => name.split("=")[0]);
  return [...new Set(names)].join(",");
}
