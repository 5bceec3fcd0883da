//! Points of the ranges whose scenarios have faults: the values of the factors do not go together there.
//!
//! A study checks the corners of its ranges when it is submitted, and meets such points later. It goes on without them. Its answer names
//! them, and later decisions know them from there.

use std::collections::{BTreeMap, BTreeSet};

use roost_api::Fault;
use roost_design::{ExcludedPoint, Goal, Point};
use serde::Deserialize;
use serde_json::Value;

use super::Study;

/// A point of the ranges whose scenario has faults.
#[derive(Clone, Debug)]
pub(crate) struct ImpossiblePoint {
    /// Values of the factors: numbers in their units, or levels.
    values: Vec<Value>,
    /// The first fault.
    reason: String,
}

/// The points of a stored answer at which nothing can be run.
pub(crate) fn impossible_points(answer: Option<&Value>) -> Result<Vec<ImpossiblePoint>, serde_json::Error> {
    let Some(excluded) = answer.and_then(|answer| answer.get("excluded")) else { return Ok(Vec::new()) };
    let points = Vec::<ExcludedPoint>::deserialize(excluded)?.into_iter().filter_map(|point| {
        let ExcludedPoint { values, impossible, .. } = point;
        Some(ImpossiblePoint { values, reason: impossible? })
    });
    Ok(points.collect())
}

impl Study {
    /// The points at which earlier decisions found that nothing can be run, each with the reason.
    pub(super) fn impossible(&self) -> BTreeMap<Point, String> {
        let points = self.impossible.iter().filter_map(|known| {
            Some((Point::of_run(&self.question.factors, &known.values)?, known.reason.clone()))
        });
        points.collect()
    }

    /// Those of some points whose scenarios have faults.
    pub(super) fn refused<'a>(
        &self,
        points: impl IntoIterator<Item = &'a Point>,
    ) -> BTreeMap<Point, Vec<Fault>> {
        let points: BTreeSet<&Point> = points.into_iter().collect();
        let refused = points.into_iter().filter_map(|point| Some((point.clone(), self.made(point).err()?)));
        refused.collect()
    }

    /// The points of an estimate; none for another goal.
    pub(super) fn estimated_points(&self) -> Vec<Point> {
        let Goal::Estimate(goal) = &self.question.goal else { return Vec::new() };
        goal.points.iter().filter_map(|values| Point::of_run(&self.question.factors, values)).collect()
    }
}
