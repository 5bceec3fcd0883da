//! Turns of projects and owners as the model knows them: what each has had in the current round.

use std::collections::{BTreeMap, BTreeSet};

use super::model::Waiting;

/// Tokens that submit, with the rows of their projects.
pub(super) const OWNERS: [(&str, i64); 4] = [("", 0), ("a", 1), ("b", 0), ("c", 1)];

/// The share of each project.
pub(super) const SHARES: [u32; 2] = [1, 2];

/// The project of an owner.
fn project(owner: &str) -> i64 {
    OWNERS.iter().find(|(token, _)| *token == owner).expect("a known owner").1
}

/// Jobs of one priority that projects and owners have had in the current round.
#[derive(Clone, Debug, Default)]
pub(super) struct Served {
    projects: BTreeMap<i64, u32>,
    owners: BTreeMap<i64, BTreeSet<&'static str>>,
    /// All jobs up to now, and this number at the last one of each project and owner.
    jobs: u64,
    last_of_projects: BTreeMap<i64, u64>,
    last_of_owners: BTreeMap<&'static str, u64>,
}

impl Served {
    /// Records a job of an owner. A job beyond the share of its project starts the next round of projects, and a second one of its owner
    /// the next round of the owners of this project.
    pub(super) fn serve(&mut self, owner: &'static str) {
        let project = project(owner);
        self.jobs += 1;
        self.last_of_projects.insert(project, self.jobs);
        self.last_of_owners.insert(owner, self.jobs);
        if self.is_full(project) {
            self.projects.clear();
        }
        *self.projects.entry(project).or_default() += 1;
        let owners = self.owners.entry(project).or_default();
        if !owners.insert(owner) {
            *owners = BTreeSet::from([owner]);
        }
    }

    fn had(&self, project: i64) -> u32 {
        self.projects.get(&project).copied().unwrap_or(0)
    }

    fn is_full(&self, project: i64) -> bool {
        self.had(project) == SHARES[project as usize]
    }

    /// The place of the next of these jobs, of which each owner has one: of the project that has had the smallest part of its share,
    /// first of an owner without a job in the round of the project. Of several such projects or owners, the one whose last job is the
    /// longest ago comes first, then the oldest job.
    pub(super) fn next(&self, firsts: &BTreeMap<&'static str, usize>, jobs: &[Waiting]) -> usize {
        let mut of_projects: BTreeMap<i64, _> = BTreeMap::new();
        for (owner, place) in firsts {
            let project = project(owner);
            let is_served = self.owners.get(&project).is_some_and(|owners| owners.contains(owner));
            let rank = (is_served, self.last_of_owners.get(owner), jobs[*place].seq, *place);
            let best = of_projects.entry(project).or_insert(rank);
            *best = rank.min(*best);
        }
        let part = |project: i64| {
            let is_full = self.is_full(project);
            (is_full, if is_full { 0 } else { 60 * self.had(project) / SHARES[project as usize] })
        };
        let ranked = of_projects.iter().map(|(project, (.., seq, place))| {
            (part(*project), self.last_of_projects.get(project), *seq, *place)
        });
        ranked.min().expect("one of that priority").3
    }
}
