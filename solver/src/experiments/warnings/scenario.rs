//! Warnings that need no run: time step, fill of the lattice, tissue too soft for its own weight, walls in a wrong place, and a belt too slow for the time of a jam.

use super::{OPEN_FILLING_REGION, SLOW_BELT, SOFT_TISSUE, THIN_FILLET, UNSTABLE_TIMESTEP, WHOLE_SPHERES};
use crate::engine::scene::BodyKind;
use crate::experiments::Setup;
use crate::experiments::belt::belt_speed_m_s;
use crate::experiments::filling::{Side, heights_m, sides};
use crate::physics::hertz::tissue_on_rigid;
use crate::result::Warning;
use crate::scenario::{Experiment, Fill, Scenario};

/// Overlap with the floor, over R, from which tissue counts as too soft. In a hopper of 64 fillets with R = 8 mm none sank at 0.45, 7 % of
/// the mass at 0.59, 36 % at 0.71 and all at 1.5.
const SOFT_OVERLAP_RATIO: f64 = 0.5;

/// Layers of sub-particles below which the stiffness of a fillet depends on the radius.
const FEWEST_LAYERS: usize = 4;

/// Way of the belt during a stoppage, over the diameter of a sub-particle, below which a steady flow may count as a jam. Sub-particles of a
/// layer are a diameter apart, and gaps between fillets add to that.
const SHORTEST_WAY_RATIO: f64 = 3.0;

/// The warnings of a scenario.
pub fn of_scenario(setup: &Setup) -> Vec<Warning> {
    let rules = [timestep, whole_spheres, thin_fillet, soft_tissue, open_filling_region, slow_belt];
    rules.into_iter().filter_map(|rule| rule(setup)).collect()
}

fn timestep(setup: &Setup) -> Option<Warning> {
    let (dt, damped) = (setup.timestep_s(), setup.bounds().damped_s);
    let figures = format!(
        "timestep_s {dt:.3e} s is past {damped:.3e} s, the stability limit with damping: the run may diverge."
    );
    (dt > damped).then(|| UNSTABLE_TIMESTEP.with(&figures))
}

/// Mass does not suffer where the product has its density from its volume: the fewer sub-particles are then heavier.
fn whole_spheres(setup: &Setup) -> Option<Warning> {
    let product = &setup.scenario.product;
    let takes_fill = !matches!(setup.scenario.experiment, Experiment::Compress { .. });
    let concerned = takes_fill && product.fill == Fill::WholeSpheres;
    let cell_m3 = (2.0 * product.radius_m()).powi(3);
    let sum = |of: &dyn Fn(&BodyKind) -> f64| setup.kinds.iter().map(of).sum::<f64>();
    let volume_m3 = sum(&|kind| kind.meta.volume_m3);
    let filled = sum(&|kind| cell_m3 * kind.meta.points.len() as f64) / volume_m3;
    let mass_kg = sum(&BodyKind::mass_kg);
    let figures = format!(
        "With fill whole_spheres the lattice takes {:.0} % of the shape's volume, at a mean density of {:.0} kg/m³ of the shape: \
         bodies are thinner than drawn, and their sub-particles are denser than the product.",
        100.0 * filled,
        mass_kg / volume_m3,
    );
    concerned.then(|| WHOLE_SPHERES.with(&figures))
}

/// The fillet with the fewest layers. A block has the layers that its scenario asks for, and a single sub-particle cannot bend.
fn thin_fillet(setup: &Setup) -> Option<Warning> {
    if matches!(setup.scenario.experiment, Experiment::Compress { .. }) {
        return None;
    }
    let radius_m = setup.scenario.product.radius_m();
    let bendable = setup.kinds.iter().filter(|kind| kind.meta.points.len() > 1);
    let layers = bendable.map(|kind| kind.meta.layers(radius_m)).min()?;
    let figures = format!("A fillet is {layers} sub-particles thick, fewer than {FEWEST_LAYERS}.");
    (layers < FEWEST_LAYERS).then(|| THIN_FILLET.with(&figures))
}

/// Hertz: a sub-particle on a rigid floor that bears the weight p (2R)² is pressed in by δ, p (2R)² = 4/3 E* √R δ^{3/2}. So δ/R =
/// (3 p / E*)^{2/3}, whatever R.
fn soft_tissue(setup: &Setup) -> Option<Warning> {
    let (scenario, material) = (&setup.scenario, &setup.scenario.material);
    let pressure_pa = floor_pressure_pa(setup, scenario);
    let e_star = tissue_on_rigid(material.youngs_modulus_pa, material.poisson_ratio).youngs;
    let ratio = (3.0 * pressure_pa / e_star).powf(2.0 / 3.0);
    let figures = format!(
        "At a Young's modulus of {} Pa the weight, {pressure_pa:.0} Pa on the floor, presses a sub-particle {ratio:.2} R into it; at 1 R \
         bodies sink through.",
        material.youngs_modulus_pa,
    );
    (ratio > SOFT_OVERLAP_RATIO).then(|| SOFT_TISSUE.with(&figures))
}

/// A hopper of own surfaces whose walls do not enclose the floor, as where a part is in a wrong place.
fn open_filling_region(setup: &Setup) -> Option<Warning> {
    let Experiment::Hopper { equipment } = &setup.scenario.experiment else { return None };
    if equipment.parametric {
        return None;
    }
    let faulty: Vec<String> = sides(equipment, setup.scene()).iter().flat_map(faults_of_side).collect();
    let ([low, _, high], half_m) = (heights_m(equipment), equipment.hopper_width_m / 2.0);
    let figures = format!(
        "Fillets drop into the region from x = {:.3} to 0 m and y = {:.3} to {half_m:.3} m. Roost drew horizontal lines from its middle, \
         at heights of {low:.3} to {high:.3} m. {}",
        -equipment.hopper_length_m,
        -half_m,
        faulty.join(" "),
    );
    (!faulty.is_empty()).then(|| OPEN_FILLING_REGION.with(&figures))
}

/// What is wrong with the walls on one side, in sentences.
fn faults_of_side(side: &Side) -> Vec<String> {
    let Side { direction, lines, open, inside, deepest_m } = side;
    let open =
        (*open > 0).then(|| format!("Towards {direction}, {open} of {lines} lines meet no wall nearby."));
    let inside = (*inside > 0).then(|| {
        format!(
            "Towards {direction}, {inside} of {lines} lines meet a wall inside the region, up to {deepest_m:.3} m from its border."
        )
    });
    open.into_iter().chain(inside).collect()
}

/// A belt at rest carries nothing, so that a jam is no error there.
fn slow_belt(setup: &Setup) -> Option<Warning> {
    let Experiment::Hopper { equipment } = &setup.scenario.experiment else { return None };
    let speed_m_s = belt_speed_m_s(equipment, || setup.scene()).ok().filter(|speed| *speed > 0.0)?;
    let jam_s = setup.scenario.numerics.shortest_jam_s();
    let way_m = SHORTEST_WAY_RATIO * 2.0 * setup.scenario.product.radius_m();
    let figures = format!(
        "In {jam_s} s, after which a hopper counts as jammed, the belt moves {:.3e} m at {speed_m_s} m/s: less than three diameters of a \
         sub-particle, {way_m:.3e} m, which take {:.2} s. Steady flow may count as a jam.",
        speed_m_s * jam_s,
        way_m / speed_m_s,
    );
    (speed_m_s * jam_s < way_m).then(|| SLOW_BELT.with(&figures))
}

/// Weight on the floor over its area: of the first filling in a hopper, without what a feed brings later; elsewhere of one body of the smallest height that it can lie at.
fn floor_pressure_pa(setup: &Setup, scenario: &Scenario) -> f64 {
    let gravity = scenario.numerics.gravity_m_s2;
    if let Experiment::Hopper { equipment } = &scenario.experiment {
        let area_m2 = equipment.hopper_length_m * equipment.hopper_width_m;
        let filled = setup.kind_of_each().into_iter().take(scenario.product.count as usize);
        return gravity * filled.map(|kind| setup.kinds[kind].mass_kg()).sum::<f64>() / area_m2;
    }
    // A column of sub-particles, one per layer of the lattice, over the square that each takes.
    let cell_m2 = (2.0 * scenario.product.radius_m()).powi(2);
    let column_kg = |kind: &BodyKind| {
        let heights = || kind.meta.points.iter().map(|point| point.z);
        let height_m = heights().fold(f64::NEG_INFINITY, f64::max) - heights().fold(f64::INFINITY, f64::min);
        kind.subparticle_mass_kg * (height_m / (2.0 * scenario.product.radius_m()) + 1.0)
    };
    gravity * setup.kinds.iter().map(column_kg).fold(0.0, f64::max) / cell_m2
}
