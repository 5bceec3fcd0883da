//! The actions of workers with fills that jobs share: upload, withdrawal, and the server's deletion.

use bytes::Bytes;
use roost_api::ids::JobId;
use roost_api::lease::ClaimedAttempt;
use roost_api::time::Timestamp;

use super::super::fills::{Fill, Fills};
use super::{BACKENDS, SCENARIOS, World, fill_of};
use crate::store::database::query;

/// The object of a fill.
fn bytes_of(fill: usize, backend: &str) -> Bytes {
    Bytes::from(format!("fill {fill} {backend}"))
}

impl World<'_> {
    /// Checks the fill of a claimed attempt, in the state before the claim.
    pub(super) fn check_fill(&self, index: usize, attempt: &ClaimedAttempt) {
        let (worker, job) = (&self.workers[index], &self.model.jobs[&attempt.job_id]);
        let stored =
            job.fill.filter(|fill| self.model.fills.get(&(*fill, worker.backend)) == Some(&Fill::Stored));
        let order = attempt.fill.as_ref();
        assert_eq!(order.is_some(), job.fill.is_some() && worker.shares_fills, "{attempt:?}");
        if let Some(order) = order {
            let expected =
                stored.map(|fill| blake3::hash(&bytes_of(fill, worker.backend)).to_hex().to_string());
            assert_eq!(order.stored.as_ref().map(|stored| stored.digest.clone()), expected, "{attempt:?}");
        }
    }

    /// An attempt, at times a stale one, and the place of its worker or of another one.
    fn any_attempt(&mut self) -> Option<(usize, (JobId, u32))> {
        let index = self.any_worker();
        let held = self.workers[index].held.clone();
        let known = held.into_iter().chain(self.reports.iter().map(|it| (it.job, it.attempt)));
        Some((index, self.random.choice(known.collect::<Vec<_>>())?))
    }

    /// A worker uploads a fill.
    pub(super) async fn upload_fill(&mut self) {
        let Some((index, (job, attempt))) = self.any_attempt() else { return };
        let (id, backend) = (self.workers[index].id, self.workers[index].backend);
        let which = self.digests.iter().find(|(known, _)| *known == job).unwrap().1;
        let stream = futures_util::stream::iter([Ok::<_, std::io::Error>(bytes_of(fill_of(which), backend))]);
        let staged = self.store.stage(stream, 1000).await.expect("within the limit");
        let recorded = self.store.record_fill(job, attempt, id, staged, 1000, self.now.wall).await.unwrap();
        self.steps.push(format!("worker {index} uploads the fill of {job} {attempt}: {recorded:?}"));
        let may = self.model.jobs[&job].may_write(attempt, id);
        let expected = may.then(|| self.model.store_fill(job, backend));
        assert_eq!(recorded.ok(), expected);
    }

    /// A worker withdraws a fill, or the server deletes some.
    pub(super) async fn change_fills(&mut self) {
        match self.random.u32(0..4) {
            0 | 1 => self.withdraw_fill().await,
            2 => {
                self.store.forget_ended_fills().await.unwrap();
                self.steps.push("fills of ended attempts are forgotten".to_owned());
                self.model.forget_ended_fills();
            }
            _ => {
                let all = Timestamp(i64::MAX);
                self.store.prune_fills(all, all).await.unwrap();
                self.steps.push("fills are deleted".to_owned());
                self.model.fills.retain(|_, fill| matches!(fill, Fill::Computing(..)));
            }
        }
    }

    async fn withdraw_fill(&mut self) {
        let Some((index, (job, attempt))) = self.any_attempt() else { return };
        let (id, backend) = (self.workers[index].id, self.workers[index].backend);
        let fill = fill_of(self.digests.iter().find(|(known, _)| *known == job).unwrap().1);
        let stored = self.random.bool();
        let digest = stored.then(|| blake3::hash(&bytes_of(fill, backend)).to_hex().to_string());
        let withdrawn = self.store.withdraw_fill(job, attempt, id, digest, self.now.wall).await.unwrap();
        self.steps.push(format!("worker {index} withdraws the fill of {job} {attempt}: {withdrawn:?}"));
        let may = self.model.jobs[&job].may_write(attempt, id);
        let expected = may.then(|| self.model.withdraw_fill((job, attempt), backend, stored));
        assert_eq!(withdrawn.ok(), expected);
    }

    /// Compares the fills of the store with those of the model.
    pub(super) async fn compare_fills(&self) {
        let sql = "SELECT fill_digest, backend, job_id, attempt, object_digest FROM fills";
        let rows = query(sql).fetch_all(&self.store.readers).await.unwrap();
        let stored = rows.iter().map(|row| {
            let digest: String = row.get("fill_digest");
            let which = SCENARIOS.iter().position(|(it, _)| it.fill_digest().as_ref() == Some(&digest));
            let backend = BACKENDS.into_iter().find(|it| *it == row.get::<String>("backend"));
            let job: Option<String> = row.get("job_id");
            let fill = match (job, row.get::<Option<String>>("object_digest")) {
                (Some(job), None) => Fill::Computing(job.parse().unwrap(), row.get("attempt")),
                (None, Some(_)) => Fill::Stored,
                (None, None) => Fill::Withdrawn,
                (Some(_), Some(_)) => panic!("both computed and stored"),
            };
            ((fill_of(which.expect("known")), backend.expect("known")), fill)
        });
        assert_eq!(stored.collect::<Fills>(), self.model.fills);
    }
}
