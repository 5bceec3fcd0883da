//! Bend angles of fillets past the gate: the "curling" and "draping" of section 3.4.

use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};

use crate::engine::frame::Frame;
use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::observe::BendGauge;

/// Maximum distance of a centre of mass past the gate, in metres.
const PAST_GATE_M: f64 = 0.2;

/// The bend angles of the fillets just past the gate, sample by sample.
#[derive(Debug)]
pub(super) struct Curls {
    /// Of each kind of fillet: for its shape, and of how many sub-particles it is.
    gauges: Vec<(BendGauge, usize)>,
    /// The kind of each fillet.
    kinds: Vec<usize>,
    pub(super) samples: Vec<Curl>,
}

/// The bend angles of one sample, in degrees.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Curl {
    t_s: f64,
    count: u32,
    sum_deg: f64,
    largest_deg: f64,
}

impl Curls {
    pub(super) fn new(scene: &Scene) -> Self {
        let points = scene.kinds.iter().map(|kind| &kind.meta.points);
        Self {
            gauges: points.map(|points| (BendGauge::new(points), points.len())).collect(),
            kinds: scene.bodies.iter().map(|body| body.kind).collect(),
            samples: Vec::new(),
        }
    }

    /// Takes in a sample. A fillet of which a part has left the simulation is passed over.
    pub(super) fn note(&mut self, state: &State, now_s: f64) {
        let mut curl = Curl { t_s: now_s, count: 0, sum_deg: 0.0, largest_deg: 0.0 };
        for (body, range) in state.body_ranges() {
            let (gauge, count) = &self.gauges[self.kinds[body as usize]];
            let x = range.clone().map(|i| state.position(i).x).sum::<f64>() / range.len() as f64;
            if range.len() != *count || x <= 0.0 || x > PAST_GATE_M {
                continue;
            }
            let particles = &state.particles[range];
            let place = |i: usize| particles[i].position;
            let Some(angle) = gauge.angle_deg(|i| step(&state.frame, place, i)) else { continue };
            curl.count += 1;
            curl.sum_deg += angle;
            curl.largest_deg = curl.largest_deg.max(angle);
        }
        if curl.count > 0 {
            self.samples.push(curl);
        }
    }

    /// The mean over all fillets and samples until a time in seconds, and the largest angle; none when there were none.
    pub(super) fn mean_and_largest_deg(&self, until_s: f64) -> Option<(f64, f64)> {
        let samples = || self.samples.iter().take_while(|curl| curl.t_s <= until_s);
        let count: u32 = samples().map(|curl| curl.count).sum();
        let sum: f64 = samples().map(|curl| curl.sum_deg).sum();
        let largest = samples().map(|curl| curl.largest_deg).fold(0.0, f64::max);
        (count > 0).then(|| (sum / f64::from(count), largest))
    }
}

/// From the `i`th sub-particle to the next, in metres; across the periodic seam too.
fn step(frame: &Frame, place: impl Fn(usize) -> IVec3, i: usize) -> DVec3 {
    frame.between(place(i), place(i + 1)).as_dvec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Fill;
    use crate::shape::lattice::MetaParticle;
    use crate::shape::teardrop::Teardrop;

    #[test]
    fn flat_fillet_across_a_periodic_boundary_has_no_bend_angle() {
        let size_m = [0.176, 0.072, 0.032];
        let shape = MetaParticle::fill(&Teardrop { size_m, mirrored: false }, 0.004, Fill::Centres, 1);
        let gauge = BendGauge::new(&shape.points);
        let frame = Frame::new(DVec3::new(-0.5, -0.1, -0.5), DVec3::new(0.5, 0.1, 0.5), true);
        for shift in 0..10 {
            // Lying along y, the blunt end at `shift` fiftieths of a metre.
            let turned = shape.points.iter().map(|p| DVec3::new(-p.y, p.x + 0.02 * f64::from(shift), p.z));
            let places: Vec<IVec3> = turned.map(|point| frame.wrap(frame.encode(point))).collect();
            let angle = gauge.angle_deg(|i| step(&frame, |k| places[k], i)).expect("it has two ends");
            assert!(angle < 0.1, "{angle}° at {shift}");
        }
    }
}
