//! Submission of sweeps in slices: the model gets their jobs when the sweep is visible, or never if the server dies.

use roost_api::ids::{JobId, SweepId};
use roost_api::job::JobState;
use serde_json::Map;

use super::super::model::Job;
use super::super::turns::OWNERS;
use super::{SCENARIOS, World, fill_of};
use crate::store::database::{query_as, query_scalar};
use crate::store::deletion::mark_leftovers;
use crate::store::submit::{NewSweep, SlicedSweep};
use crate::sweep::Trial;

/// A sweep that is being submitted.
pub(super) struct SimulatedSubmission {
    id: SweepId,
    priority: i32,
    owner: &'static str,
    /// The scenario of each job.
    scenarios: Vec<usize>,
    stored: SlicedSweep,
}

impl World<'_> {
    /// Begins a sweep, stores its jobs, or makes it visible.
    pub(super) async fn submit_slice(&mut self) {
        let Some(SimulatedSubmission { id, priority, owner, scenarios, mut stored }) = self.submission.take()
        else {
            return self.begin_sweep().await;
        };
        let more = self.store.store_slice(&mut stored, self.now.wall).await.unwrap();
        self.steps
            .push(format!("sweep {id}: {}", if more { "its jobs are stored" } else { "it is visible" }));
        if more {
            self.submission = Some(SimulatedSubmission { id, priority, owner, scenarios, stored });
            return;
        }
        let sql = "SELECT id, point, state FROM jobs WHERE sweep_id = ? ORDER BY point";
        let rows: Vec<(String, i64, String)> =
            query_as(sql).bind(id.to_string()).fetch_all(&self.store.readers).await.unwrap();
        assert_eq!(rows.len(), scenarios.len());
        for (job, point, state) in rows {
            // Whatever happened meanwhile: nobody could claim or cancel it.
            assert_eq!(state, JobState::Queued.as_str());
            let job: JobId = job.parse().unwrap();
            let mut model = Job::new((priority, owner), None, None, None, false);
            model.fill = Some(fill_of(scenarios[point as usize]));
            self.model.jobs.insert(job, model);
            self.digests.push((job, scenarios[point as usize]));
        }
    }

    async fn begin_sweep(&mut self) {
        let id = SweepId(self.uuid());
        let (priority, (owner, _)) = (self.random.i32(0..2), self.random.choice(OWNERS).unwrap());
        let scenarios: Vec<usize> = (0..2).map(|_| self.random.usize(0..SCENARIOS.len())).collect();
        let trial = |(point, which): (usize, &usize)| Trial {
            point: point as u32,
            replicate: 0,
            scenario: SCENARIOS[*which].0.clone(),
            levels: Some(Map::new()),
        };
        let trials: Vec<Trial> = scenarios.iter().enumerate().map(trial).collect();
        let sweep = NewSweep::simulated(id, (owner, priority), trials);
        let stored = self.store.begin_sweep(sweep, self.now.wall).await.unwrap().unwrap();
        self.steps.push(format!("begin sweep {id} of '{owner}' at {priority}: scenarios {scenarios:?}"));
        self.submission = Some(SimulatedSubmission { id, priority, owner, scenarios, stored });
    }

    /// A restarted server deletes what it has of the sweep.
    pub(super) async fn interrupt_submission(&mut self) {
        let Some(SimulatedSubmission { id, .. }) = self.submission.take() else { return };
        self.store.writer.write(|tx| Box::pin(mark_leftovers(tx))).await.unwrap();
        self.store.delete_leftovers().await.unwrap();
        let sql = "SELECT (SELECT count(*) FROM jobs WHERE sweep_id = ?1) + (SELECT count(*) FROM sweeps WHERE id = ?1)";
        let left: i64 = query_scalar(sql).bind(id.to_string()).fetch_one(&self.store.readers).await.unwrap();
        assert_eq!(left, 0, "sweep {id}");
        self.steps.push(format!("sweep {id} is gone"));
    }
}
