//! Time step, duration, sampling and stopping.

use serde::{Deserialize, Serialize};

use crate::scenario::field::{Field, FieldKind, Preset, Range, above_to, from_to};
use crate::scenario::row::{field, flag, nullable, number};

/// Time step, duration, sampling and stopping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Numerics {
    /// Time step.
    pub timestep_s: Timestep,
    /// Simulated time from belt start, in seconds.
    pub duration_s: f64,
    /// Interval between samples, in seconds.
    pub output_interval_s: f64,
    /// A hopper without a passage for this long, in seconds, has jammed.
    pub jam_after_s: f64,
    /// Conditions that end a run before its duration.
    pub stop: Stop,
    /// Acceleration of gravity, in m/s².
    pub gravity_m_s2: f64,
    /// The bed is at rest once all but one in a thousand of its sub-particles are slower than this, in m/s.
    pub rest_speed_m_s: f64,
    /// Maximum duration of a fill, in seconds.
    pub max_fill_s: f64,
    /// A sub-particle faster than this makes the run `unstable`, in m/s.
    pub speed_limit_m_s: f64,
    /// Run time steps past the stability limit, as a stability study needs.
    pub allow_unstable: bool,
}

impl Numerics {
    /// Time without a passage that makes a jam, in seconds. A run that ends early as jammed has jammed.
    pub fn shortest_jam_s(&self) -> f64 {
        self.stop.when_jammed_s.map_or(self.jam_after_s, |when_s| when_s.min(self.jam_after_s))
    }
}

/// A time step: a number of seconds, or `"auto"` for the largest safe one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Timestep {
    /// Seconds.
    Fixed(f64),
    /// Chosen from stiffness, mass, damping and the speed at the start.
    Auto(Auto),
}

/// The word `"auto"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Auto {
    /// The only value.
    Auto,
}

/// Conditions that end a run before its duration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Stop once every fillet has left.
    pub when_empty: bool,
    /// Stop once nothing has passed the gate for this long, in seconds; null never.
    pub when_jammed_s: Option<f64>,
    /// Stop once the results are known.
    pub when_done: bool,
}

const TIME: Range = above_to(0.0, 600.0);

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    field("/numerics/timestep_s", FieldKind::NumberOrAuto(from_to(1e-9, 0.1)), "s", Preset::Number(5.75e-5), "Table 2",
        "Time step of the simulation. Above a certain time step, the stability limit, the simulation can become unstable (numerical errors \
         grow without limit). `auto`: Roost computes a time step safely below this limit. The computation uses stiffness, mass, damping \
         and the maximum speed of a body at the start."),
    number("/numerics/duration_s", "s", 6.0, TIME, "numerics",
        "Maximum simulated time after t = 0. At t = 0, the belt or the test starts.")
        .acts_from_start()
        .by_name(),
    number("/numerics/output_interval_s", "s", 0.02, above_to(0.0, 0.1), "numerics",
        "Time between two samples of the series."),
    number("/numerics/jam_after_s", "s", 1.0, TIME, "numerics",
        "Minimum time of a stoppage that counts as a jam. A hopper has jammed when nothing passes the gate for this time, while at least \
         5 % of the filled mass is inside. If `when_jammed_s` is shorter than this time, Roost uses `when_jammed_s` instead.")
        .acts_from_start()
        .by_name(),
    flag("/numerics/stop/when_empty", true, "numerics",
        "Whether the simulation ends when no body is left. In a hopper, every fillet has then passed the gate. In a scene, every body \
         has then left the simulated space.")
        .acts_from_start()
        .by_name(),
    nullable("/numerics/stop/when_jammed_s", "s", TIME, "numerics",
        "If nothing passes the gate for this time, the simulation ends. The simulation then ends even if little mass is left inside. \
         Null: a jam does not end the simulation.")
        .acts_from_start()
        .by_name(),
    flag("/numerics/stop/when_done", true, "numerics",
        "Whether the simulation ends as soon as its result is known. The result is known when the bodies are at rest (`drop`, `bend`, \
         `scene`), when the fillet slides (`slide`), or when the strain reaches `max_strain` (`compress`).")
        .acts_from_start()
        .by_name(),
    number("/numerics/gravity_m_s2", "m/s²", 9.81, from_to(0.0, 100.0), "assumed",
        "Acceleration of gravity. In `compress`, the default is 0, because the weight of the block would distort the curve of stress \
         over strain."),
    number("/numerics/rest_speed_m_s", "m/s", 0.05, above_to(0.0, 1.0), "numerics",
        "Speed limit for rest: the bodies are at rest when 99.9 % of the sub-particles are slower than this speed. In `hopper`, `bend` \
         and `slide`, t = 0 is the moment at which the bodies have come to rest. The experiment `compress` does not use this field."),
    number("/numerics/max_fill_s", "s", 10.0, TIME, "numerics",
        "Maximum time for the fillets to come to rest. If the fillets are not at rest after this time, the simulation ends before t = 0.")
        .by_name(),
    number("/numerics/speed_limit_m_s", "m/s", 30.0, from_to(1.0, 10_000.0), "numerics",
        "Maximum speed of a sub-particle. If a sub-particle is faster, the simulation ends with the end reason `unstable`."),
    flag("/numerics/allow_unstable", false, "numerics",
        "Whether Roost accepts a time step above the stability limit. For this check, Roost computes the limit without damping. Use the \
         value true only to study the stability."),
];
