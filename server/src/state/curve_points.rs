//! Points of curves in result documents, which calibrations compare with measured ones. Rows of trials have responses alone.

use std::collections::BTreeMap;
use std::sync::Arc;

use quick_cache::sync::Cache;
use roost_api::ids::JobId;
use roost_api::job::JobState;
use roost_api::table::TrialRow;
use roost_solver::result::RunResult;
use serde_json::json;

use crate::store::{Store, StoreError};
use crate::study::Study;

/// Maximum number of runs whose points are kept.
const MAX_RUNS: usize = 10_000;

/// Points by run: a decision reads the documents of new runs only.
pub(crate) struct CurvePoints(Cache<JobId, Arc<BTreeMap<String, f64>>>);

impl Default for CurvePoints {
    fn default() -> Self {
        Self(Cache::new(MAX_RUNS))
    }
}

impl CurvePoints {
    /// Adds the points that a study needs to the responses of its trials.
    pub(crate) async fn complete(
        &self,
        store: &Store,
        study: &Study,
        trials: &mut [TrialRow],
    ) -> Result<(), StoreError> {
        for trial in trials.iter_mut().filter(|trial| trial.state == JobState::Succeeded) {
            let Some(wanted) = study.curve_points(trial) else { continue };
            let found = match self.0.get(&trial.job_id) {
                Some(found) => found,
                None => {
                    let document = store.result(trial.job_id).await?.and_then(|result| result.document);
                    let result = document.and_then(|text| serde_json::from_str::<RunResult>(&text).ok());
                    let points = wanted.iter().filter_map(|(name, observable)| {
                        Some((name.clone(), observable.value(result.as_ref()?)?))
                    });
                    let found: Arc<BTreeMap<String, f64>> = Arc::new(points.collect());
                    self.0.insert(trial.job_id, found.clone());
                    found
                }
            };
            trial.responses.extend(found.iter().map(|(name, value)| (name.clone(), json!(value))));
        }
        Ok(())
    }
}
