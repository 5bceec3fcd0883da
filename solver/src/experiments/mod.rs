//! The experiments: from a scenario to a scene, and from samples to results.
//!
//! A folder per experiment. Its section of the scenario implements [`Definition`], and it joins [`definition()`] and
//! [`ALL`] here.

mod belt;
mod bend;
mod bodies;
mod clashes;
mod compress;
mod definition;
mod drop;
mod energy;
mod filling;
mod hopper;
mod interpenetration;
pub mod laws;
mod loads;
mod outputs;
pub mod placement;
mod scene;
mod setup;
mod slide;
pub mod surfaces;
mod warnings;

pub use bodies::{bounds_on_timestep, timestep_s};
pub use definition::Definition;
pub use outputs::{
    CurveRow, Outputs, ResponseDefinition, ResponseType, SeriesRow, Shared, all_curves, all_responses,
    all_series, is_indicator, output_tables_markdown, outputs, outputs_of, overview_markdown, response_names,
};
pub use setup::{Setup, plan};
pub use warnings::{
    ALL_WARNINGS, WarningKind, of_responses as warnings_of_responses, of_scenario as warnings_of_scenario,
    warning_responses, warnings_markdown,
};

use crate::scenario::Experiment;

/// The implementation of an experiment.
pub fn definition(experiment: &Experiment) -> &dyn Definition {
    match experiment {
        Experiment::Hopper { equipment } => equipment,
        Experiment::Drop { drop } => drop,
        Experiment::Bend { bend } => bend,
        Experiment::Slide { slide } => slide,
        Experiment::Compress { compress } => compress,
        Experiment::Scene { scene } => scene,
    }
}

/// The results of all experiments, by the word under `/experiment`.
pub const ALL: &[(&str, &Outputs)] = &[
    ("hopper", &hopper::OUTPUTS),
    ("drop", &drop::OUTPUTS),
    ("bend", &bend::OUTPUTS),
    ("slide", &slide::OUTPUTS),
    ("compress", &compress::OUTPUTS),
    ("scene", &scene::OUTPUTS),
];
