//! Calibrations: the measurements of a study as targets, and the scenarios of its tests.
//!
//! A run of a calibration simulates one test with one set of parameters. The name of the test is a factor of the question beside the
//! parameters, unless there is a single test.

use std::collections::{BTreeMap, BTreeSet};

use roost_api::Fault;
use roost_api::design::Factor;
use roost_api::study::{Driver, StudySpec};
use roost_design::goals::calibrate::{CurvePlace, TEST, Target};
use roost_design::{Measure, Question};
use roost_solver::Limits;
use roost_solver::experiments::ResponseType;
use roost_solver::mesh::Meshes;
use roost_solver::observable::{Line, Observable};
use serde_json::{Map, Value, json};

use crate::document::{fault, prefixed};
use crate::measurements::{self, Lab, TestTargets};
use crate::sweep::Points;

/// Place of the measurements in a study.
const MEASUREMENTS: &str = "/goal/calibrate/measurements";
/// Maximum number of tests.
const MAX_TESTS: usize = 32;
/// Maximum number of points of a curve that are compared: more of the same specimens say little more.
const MAX_CURVE_POINTS: usize = 8;

/// A test of a calibration.
#[derive(Clone, Debug)]
pub(super) struct CalibrationTest {
    /// Its name.
    pub(super) name: String,
    /// Makes the scenarios of its runs.
    pub(super) points: Points,
    /// Numbers of its runs that are no responses, by name.
    pub(super) curve_points: BTreeMap<String, Observable>,
}

/// The measurements of a study, or their faults; none for another goal.
pub(super) fn lab(spec: &StudySpec, check: Option<(&Meshes, &Limits)>) -> Option<Result<Lab, Vec<Fault>>> {
    let goal = spec.goal.get("calibrate")?;
    let Some(document) = goal.get("measurements") else {
        let detail = "a calibration needs measurements";
        return Some(Err(vec![fault(MEASUREMENTS, Value::Null, detail, "a document of measurements")]));
    };
    Some(measurements::read_with(document.clone(), check).map_err(|faults| prefixed(MEASUREMENTS, faults)))
}

/// Faults of the members of a study that a calibration has no use for.
pub(super) fn check_members(spec: &StudySpec, lab: &Lab, faults: &mut Vec<Fault>) {
    let first = lab.tests.first().map(|test| &test.base);
    if !spec.base.is_null() && Some(&spec.base) != first {
        let detail = "each test of a calibration has a scenario of its own";
        faults.push(fault("/base", json!("a scenario"), detail, "no `base`"));
    }
    if lab.tests.len() > MAX_TESTS {
        let at = format!("{MEASUREMENTS}/tests");
        faults.push(fault(&at, json!(lab.tests.len()), "too many tests", &format!("at most {MAX_TESTS}")));
    }
    if let Some(targets) = spec.goal.pointer("/calibrate/targets") {
        let detail = "the measurements are the targets";
        faults.push(fault("/goal/calibrate/targets", targets.clone(), detail, "no `targets`"));
    }
    if !spec.seeded_by.is_empty() {
        let detail = "the runs of a sweep belong to no test";
        faults.push(fault("/seeded_by", json!(spec.seeded_by), detail, "no sweeps, or another goal"));
    }
    if spec.posterior.is_some() {
        let detail = "a calibration finds a posterior, and draws from none";
        faults.push(fault(
            "/posterior",
            Value::Null,
            detail,
            "no `posterior`; `priors` say what is known before",
        ));
    }
    if spec.driver == Driver::Client {
        let detail = "only the server runs the tests of a calibration";
        faults.push(fault("/driver", json!(spec.driver), detail, "server"));
    }
}

/// The goal of the question: targets in place of the measurements.
pub(super) fn goal(submitted: &Value, lab: &Lab) -> Value {
    let mut members: Map<String, Value> =
        submitted.get("calibrate").and_then(Value::as_object).cloned().unwrap_or_default();
    members.remove("measurements");
    let targets: Vec<Target> = lab.tests.iter().flat_map(targets).collect();
    members.insert("targets".to_owned(), json!(targets));
    json!({"calibrate": members})
}

/// The factor of the tests, for a question; none for a single test.
pub(super) fn test_factor(lab: &Lab) -> Option<Value> {
    let names: Vec<&str> = lab.tests.iter().map(|test| test.name.as_str()).collect();
    (names.len() > 1).then(|| json!({"name": TEST, "levels": names}))
}

/// The targets of a test; of a curve with many points, some that lie evenly in the list.
fn targets(test: &TestTargets) -> Vec<Target> {
    let mut curves: BTreeMap<String, usize> = BTreeMap::new();
    for target in &test.targets {
        if let Observable::Point { line, .. } = &target.observable {
            *curves.entry(curve_name(line)).or_default() += 1;
        }
    }
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    let mut targets = Vec::new();
    for target in &test.targets {
        let curve = match &target.observable {
            Observable::Response(_) => None,
            Observable::Point { line, at } => {
                let name = curve_name(line);
                let place = places.entry(name.clone()).or_default();
                let is_chosen = is_spread(*place, curves[&name]);
                *place += 1;
                if !is_chosen {
                    continue;
                }
                Some(CurvePlace { name, at: *at })
            }
        };
        targets.push(Target {
            test: test.name.clone(),
            of: measure(&target.observable),
            curve,
            mean: target.mean,
            deviation: target.deviation,
            n: target.n,
        });
    }
    targets
}

/// The name that the points of a curve have in common.
fn curve_name(line: &Line) -> String {
    format!("{}@{}", line.of.suffixed(), line.along.suffixed())
}

/// Whether the item at an index is one of at most [`MAX_CURVE_POINTS`] that lie evenly in a list, the last included.
fn is_spread(index: usize, count: usize) -> bool {
    let kept = count.min(MAX_CURVE_POINTS);
    (index + 1) * kept / count > index * kept / count
}

fn measure(observable: &Observable) -> Measure {
    let name = observable.to_string();
    match observable {
        Observable::Response(response)
            if matches!(response.kind, ResponseType::Indicator | ResponseType::Boolean) =>
        {
            Measure::Probability(name)
        }
        _ => Measure::Mean(name),
    }
}

/// The tests with the scenarios of their runs.
pub(super) fn tests(lab: &Lab, factors: &[Factor]) -> Vec<CalibrationTest> {
    let test = |test: &TestTargets| CalibrationTest {
        name: test.name.clone(),
        points: Points::without_rows(&test.base, &test.scenario, factors),
        curve_points: compared(test),
    };
    lab.tests.iter().map(test).collect()
}

/// The points of curves that targets use, by name.
fn compared(test: &TestTargets) -> BTreeMap<String, Observable> {
    let used: BTreeSet<String> =
        targets(test).into_iter().map(|target| target.of.response().to_owned()).collect();
    let points = test.targets.iter().map(|target| &target.observable);
    let points = points.filter(|observable| matches!(observable, Observable::Point { .. }));
    let named = points.map(|observable| (observable.to_string(), observable.clone()));
    named.filter(|(name, _)| used.contains(name)).collect()
}

/// The index of the test in the levels of a point of the question, and the values of the parameters.
pub(super) fn split<'a>(question: &Question, levels: &'a [Value]) -> (usize, &'a [Value]) {
    match (question.factors.last(), levels.split_last()) {
        (Some(factor), Some((test, parameters))) if factor.name == TEST => {
            (factor.number(test).unwrap_or_default() as usize, parameters)
        }
        _ => (0, levels),
    }
}
