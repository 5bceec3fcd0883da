//! The collection file, which lists the files of each frame with their time.

use std::fmt::Write;

/// A frame in a collection.
#[derive(Clone, Debug, PartialEq)]
pub struct CollectionEntry {
    /// Simulated time since the run began, in seconds.
    pub simulated_s: f64,
    /// Belt time in seconds; `None` before the start.
    pub belt_time_s: Option<f64>,
    /// File with its sub-particles, relative to the collection.
    pub particles: String,
    /// File with its surfaces, relative to the collection.
    pub surfaces: String,
}

/// A `.pvd` file of frames over belt time, which is negative during the fill, as in the series of a result. Before the belt starts, the last
/// frame is at 0.
pub fn collection(entries: &[CollectionEntry]) -> String {
    let start = entries.iter().find_map(|entry| Some(entry.simulated_s - entry.belt_time_s?));
    let start = start.or(entries.last().map(|entry| entry.simulated_s)).unwrap_or(0.0);
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>\n",
    );
    for entry in entries {
        // Rounded to nanoseconds, which removes the rounding errors of many steps.
        let time_s = ((entry.simulated_s - start) * 1e9).round() / 1e9 + 0.0; // no -0
        for (part, file) in [&entry.particles, &entry.surfaces].into_iter().enumerate() {
            writeln!(text, "<DataSet timestep=\"{time_s}\" part=\"{part}\" file=\"{file}\"/>")
                .expect("a string accepts all text");
        }
    }
    text + "</Collection>\n</VTKFile>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(simulated_s: f64, belt_time_s: Option<f64>) -> CollectionEntry {
        let particles = format!("vtk/particles_{simulated_s}.vtp");
        CollectionEntry { simulated_s, belt_time_s, particles, surfaces: "vtk/surfaces_0.vtp".to_owned() }
    }

    fn times(entries: &[CollectionEntry]) -> Vec<String> {
        let text = collection(entries);
        let times = text.split("timestep=\"").skip(1).step_by(2);
        times.map(|rest| rest.split('"').next().expect("a first part").to_owned()).collect()
    }

    #[test]
    fn times_are_belt_times() {
        let started = [entry(0.0, None), entry(0.5, None), entry(0.8, None), entry(1.1, Some(0.1 + 0.2))];
        assert_eq!(times(&started), ["-0.8", "-0.3", "0", "0.3"]);
        assert_eq!(times(&started[..3]), ["-0.8", "-0.3", "0"], "no belt has started: they end at 0");
        assert!(collection(&started).contains("part=\"1\" file=\"vtk/surfaces_0.vtp\""));
        assert!(collection(&[]).contains("<Collection>\n</Collection>"));
    }
}
