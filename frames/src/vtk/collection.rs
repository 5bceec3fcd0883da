//! The collection: which files belong to which time. This is the file to open.

use std::fmt::Write;

/// A frame in a collection.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Simulated time since the run began, in seconds.
    pub simulated_s: f64,
    /// Belt time in seconds; `None` before the start.
    pub belt_time_s: Option<f64>,
    /// File with its sub-particles, relative to the collection.
    pub particles: String,
    /// File with its surfaces, relative to the collection.
    pub surfaces: String,
}

/// A `.pvd` file of frames over belt time: negative while filling, as in the series of a result. Where no belt has started,
/// times end at 0.
pub fn collection(scenes: &[Scene]) -> String {
    let start = scenes.iter().find_map(|scene| Some(scene.simulated_s - scene.belt_time_s?));
    let start = start.or(scenes.last().map(|scene| scene.simulated_s)).unwrap_or(0.0);
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>\n",
    );
    for scene in scenes {
        // Nanoseconds are enough; the noise of adding up steps is not for people.
        let time_s = ((scene.simulated_s - start) * 1e9).round() / 1e9 + 0.0; // no -0
        for (part, file) in [&scene.particles, &scene.surfaces].into_iter().enumerate() {
            writeln!(text, "<DataSet timestep=\"{time_s}\" part=\"{part}\" file=\"{file}\"/>")
                .expect("a string takes all");
        }
    }
    text + "</Collection>\n</VTKFile>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(simulated_s: f64, belt_time_s: Option<f64>) -> Scene {
        let particles = format!("vtk/particles_{simulated_s}.vtp");
        Scene { simulated_s, belt_time_s, particles, surfaces: "vtk/surfaces_0.vtp".to_owned() }
    }

    fn times(scenes: &[Scene]) -> Vec<String> {
        let text = collection(scenes);
        let times = text.split("timestep=\"").skip(1).step_by(2);
        times.map(|rest| rest.split('"').next().expect("a first part").to_owned()).collect()
    }

    #[test]
    fn times_are_those_of_the_belt() {
        let started = [scene(0.0, None), scene(0.5, None), scene(0.8, None), scene(1.1, Some(0.1 + 0.2))];
        assert_eq!(times(&started), ["-0.8", "-0.3", "0", "0.3"]);
        assert_eq!(times(&started[..3]), ["-0.8", "-0.3", "0"], "no belt has started: they end at 0");
        assert!(collection(&started).contains("part=\"1\" file=\"vtk/surfaces_0.vtp\""));
        assert!(collection(&[]).contains("<Collection>\n</Collection>"));
    }
}
