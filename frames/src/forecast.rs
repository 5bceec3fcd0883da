//! The size of the frames of a run, predicted before the run.

use roost_solver::experiments::plan;
use roost_solver::result::Estimate;
use roost_solver::scenario::Scenario;

use crate::recorder::Options;
use crate::schedule::Schedule;

/// Typical simulated time until a fill rests, in seconds.
const TYPICAL_FILL_S: f64 = 2.0;
/// Bytes of the stream, measured on a bed at rest, whose differences compress least.
const WEB_BYTES_PER_SUBPARTICLE: f64 = 5.4;
/// Compressed bytes of a file of particles, measured on the same bed.
const VTK_BYTES_PER_SUBPARTICLE: f64 = 50.0;
/// Compressed bytes of a bond in the same file.
const VTK_BYTES_PER_BOND: f64 = 10.5;
/// Bytes of headers.
const BYTES_PER_FRAME: f64 = 2000.0;

/// The predicted size of the frames of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Number of frames, for a fill of typical time and a run of full duration.
    pub frames: u64,
    /// Bytes of one frame of the stream with all bodies; 0 without a stream.
    pub web_bytes: u64,
    /// Bytes of the ParaView files of one frame with all bodies; 0 without such files.
    pub vtk_bytes: u64,
}

impl Forecast {
    /// Bytes of all frames.
    pub fn bytes(&self) -> u64 {
        self.frames.saturating_mul(self.web_bytes + self.vtk_bytes)
    }
}

/// Predicts the frames of a scenario with this estimate. Discharged fillets and large meshes of moving equipment are not taken into account.
pub fn forecast(scenario: &Scenario, estimate: &Estimate, options: &Options) -> Forecast {
    let interval_s = Schedule::new(scenario, estimate.timestep_s, options.interval_s).interval_s();
    let plan = plan(scenario);
    let frames = |phase_s: f64| (phase_s / interval_s).floor() as u64 + 1;
    let of_fill = if plan.longest_fill_s > 0.0 { frames(plan.longest_fill_s.min(TYPICAL_FILL_S)) } else { 0 };
    let (particles, bonds) = (estimate.subparticles as f64, estimate.bonds as f64);
    let web = BYTES_PER_FRAME + WEB_BYTES_PER_SUBPARTICLE * particles;
    let vtk = BYTES_PER_FRAME + VTK_BYTES_PER_SUBPARTICLE * particles + VTK_BYTES_PER_BOND * bonds;
    Forecast {
        frames: of_fill + frames(plan.duration_s),
        web_bytes: if options.web { web as u64 } else { 0 },
        vtk_bytes: if options.vtk { vtk as u64 } else { 0 },
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use roost_solver::Limits;
    use serde_json::json;

    use super::*;
    use crate::testing::{bonds, hopper_with_fillets, snapshot_at};
    use crate::{vtk, web};

    const BOTH: Options = Options { interval_s: 0.05, vtk: true, web: true, limit_bytes: 0 };

    #[test]
    fn predicted_size_of_a_disturbed_bed_is_close() {
        let (scenario, scene, mut state) = hopper_with_fillets(40);
        // Displaced by up to 3 mm and moving, each on its own: a linear congruential generator.
        let mut random = 1u64;
        let mut next = || {
            random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (random >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        let mut vector = |size: f32| Vec3::new(next(), next(), next()) * size;
        for p in &mut state.particles {
            p.position += (vector(0.006) / state.frame.unit_m).as_ivec3();
            (p.velocity, p.spin) = (vector(0.1), vector(10.0));
        }
        let bonds = bonds(&scene);
        let snapshot = snapshot_at(&scene, &state, &bonds, 0.0, None);
        let header = web::Header::new(&scenario, &scene, 0.05).expect("few sub-particles");
        let stream = web::Writer::new(Vec::new(), &header).expect("memory accepts all bytes");
        let packed = stream.pack(&snapshot).expect("memory accepts all bytes").size();
        let files = vtk::particles(&snapshot, 0).len() as u64;

        let estimate =
            roost_solver::check(&scenario, &roost_solver::mesh::Meshes::default(), &Limits::default())
                .expect("a valid scenario")
                .into_estimate();
        let forecast = forecast(&scenario, &estimate, &BOTH);
        for (predicted, actual) in [(forecast.web_bytes, packed), (forecast.vtk_bytes, files)] {
            let ratio = predicted as f64 / actual as f64;
            assert!((0.9..1.4).contains(&ratio), "predicted {predicted}, actual {actual}");
        }
        // Every 0.06 s: 2 s of fill, then the run, each with a first frame.
        let duration_s = scenario.numerics.duration_s;
        assert_eq!(forecast.frames, 34 + (duration_s / 0.06) as u64 + 1);
        assert_eq!(forecast.bytes(), forecast.frames * (forecast.web_bytes + forecast.vtk_bytes));
    }

    #[test]
    fn frames_follow_the_duration_of_the_experiment() {
        let frames = |document| {
            let scenario = roost_solver::scenario::from_value(&document).expect("a valid scenario");
            let estimate =
                roost_solver::check(&scenario, &roost_solver::mesh::Meshes::default(), &Limits::default())
                    .expect("a valid scenario")
                    .into_estimate();
            forecast(&scenario, &estimate, &Options { interval_s: 0.1, ..BOTH }).frames
        };
        // Tilted to 20.1° at 2 °/s, after the fill.
        let slide = json!({"experiment": "slide", "slide": {"max_tilt_deg": 20.1, "tilt_rate_deg_s": 2.0}});
        assert_eq!(frames(slide), 21 + 101);
        // No fill.
        assert_eq!(frames(json!({"experiment": "drop", "numerics": {"duration_s": 0.5}})), 6);
        // Strain of 0.095, and 0.03 for the plates, at 0.1 1/s.
        let compress =
            json!({"experiment": "compress", "compress": {"max_strain": 0.095, "strain_rate_1_s": 0.1}});
        assert_eq!(frames(compress), 13);
    }

    #[test]
    fn formats_that_are_not_requested_have_no_size() {
        let (scenario, ..) = hopper_with_fillets(2);
        let estimate =
            roost_solver::check(&scenario, &roost_solver::mesh::Meshes::default(), &Limits::default())
                .expect("a valid scenario")
                .into_estimate();
        let of = |vtk, web| forecast(&scenario, &estimate, &Options { vtk, web, ..BOTH });
        assert_eq!((of(true, false).web_bytes, of(false, true).vtk_bytes), (0, 0));
        assert_eq!(of(true, false).vtk_bytes, of(true, true).vtk_bytes);
    }
}
