//! Schemas of the solver's documents against serialised documents.

use std::collections::BTreeSet;

use roost_solver::result::{
    Curve, EndReason, Estimate, Instability, Performance, Phase, Progress, RunResult, SCHEMA, Series,
    SolverInfo, Warning,
};
use roost_solver::scenario;
use serde::Serialize;
use utoipa::PartialSchema;

use super::*;

#[track_caller]
fn assert_same_fields<S: PartialSchema>(document: &impl Serialize) {
    let (document, schema) = (json!(document), json!(S::schema()));
    let fields = |value: &Value| -> BTreeSet<String> {
        value.as_object().expect("an object").keys().cloned().collect()
    };
    assert_eq!(fields(&schema["properties"]), fields(&document));
}

#[test]
fn schemas_have_the_fields_of_serialised_documents() {
    let series = Series { name: String::new(), unit: String::new(), t_s: vec![], values: vec![] };
    let curve = Curve {
        name: String::new(),
        unit: String::new(),
        over: String::new(),
        over_unit: String::new(),
        x: vec![],
        values: vec![],
    };
    let instability = Instability { step: 1, time_s: 0.5, reason: String::new() };
    let warning = Warning { code: String::new(), message: String::new() };
    let solver = SolverInfo {
        version: String::new(),
        revision: 1,
        backend: String::new(),
        device: String::new(),
        threads: 1,
        timestep_s: 1e-4,
    };
    let performance =
        Performance { subparticles: 1, particle_steps: 1, steps: 1, wall_s: 1.0, ns_per_particle_step: 1.0 };
    assert_same_fields::<SeriesSchema>(&series);
    assert_same_fields::<CurveSchema>(&curve);
    assert_same_fields::<WarningSchema>(&warning);
    assert_same_fields::<InstabilitySchema>(&instability);
    assert_same_fields::<SolverInfoSchema>(&solver);
    assert_same_fields::<PerformanceSchema>(&performance);
    let scenario =
        scenario::from_value(&json!({"experiment": "hopper"})).expect("the default scenario is valid");
    assert_same_fields::<RunResultSchema>(&RunResult {
        schema: SCHEMA.to_owned(),
        end_reason: EndReason::Unstable,
        instability: Some(instability),
        responses: serde_json::Map::new(),
        series: vec![series],
        curves: vec![curve],
        warnings: vec![warning],
        solver,
        performance,
        scenario_digest: scenario.digest(),
        scenario,
    });
    assert_same_fields::<EstimateSchema>(&Estimate {
        fillets: 1,
        subparticles: 1,
        bonds: 1,
        mass_kg: 1.0,
        timestep_s: 1.0,
        stable_timestep_s: 1.0,
        steps: 1,
        memory_bytes: 1,
        wall_s: 1.0,
        warnings: vec![],
    });
    assert_same_fields::<ProgressSchema>(&Progress {
        phase: Phase::Fill,
        time_s: 1.0,
        simulated_s: 1.0,
        fraction: 1.0,
        subparticles: 1,
        particle_steps: 1,
        wall_s: 1.0,
        discharged_kg: 1.0,
    });
}

#[test]
fn schemas_have_the_words_of_serialised_documents() {
    let reasons = [
        EndReason::Duration,
        EndReason::Empty,
        EndReason::Jammed,
        EndReason::Done,
        EndReason::FillNotAtRest,
        EndReason::Unstable,
        EndReason::Cancelled,
    ];
    assert_eq!(json!(EndReasonSchema::schema())["enum"], json!(reasons));
    assert_eq!(json!(PhaseSchema::schema())["enum"], json!([Phase::Fill, Phase::Process]));
    // A new variant does not compile here.
    let _ = |phase| match phase {
        Phase::Fill | Phase::Process => (),
    };
    let _ = |reason| match reason {
        EndReason::Duration | EndReason::Empty | EndReason::Jammed | EndReason::Done => (),
        EndReason::FillNotAtRest | EndReason::Unstable | EndReason::Cancelled => (),
    };
}
