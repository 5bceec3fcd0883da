//! The programme: figures, each a list of named simulations and a pure function from their results to what is told.

use std::collections::HashMap;

use anyhow::{Result, anyhow};
use clap::ValueEnum;
use roost_solver::mesh::Meshes;
use roost_solver::{Limits, check, scenario};
use serde_json::{Value, json};

use super::crew::Task;
use super::picture::Shot;
use super::profile::Profile;
use super::record::Record;
use super::row::Row;
use super::stats::Seeds;

/// What the command line calls by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Part {
    /// Everything
    All,
    /// Shapes, lattice and parameters (Fig. 1 to 3, Tables 1 and 2); simulates nothing
    Model,
    /// Compression of a block (Fig. 6)
    Compress,
    /// Bending under its own weight (Fig. 7)
    Bend,
    /// Sliding down a tilted plate (Fig. 8)
    Slide,
    /// Impact on a plate (Fig. 9 to 12)
    Drop,
    /// Bulk discharge (Fig. 13 and 14, Table 3) and the proof of the time step
    Hopper,
}

/// A figure or table of the paper.
pub(super) struct Figure {
    /// As the paper counts it, such as `Fig. 9`.
    pub(super) name: &'static str,
    pub(super) title: &'static str,
    pub(super) part: Part,
    /// What the paper says, in our words and its numbers.
    pub(super) paper: &'static str,
    pub(super) runs: Vec<Run>,
    pub(super) tell: fn(&Profile, &Results<'_>) -> Told,
}

/// A simulation that a figure needs.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// Runs that differ by their seed alone share a name.
    pub(super) name: String,
    pub(super) scenario: Value,
    pub(super) shots: Vec<Shot>,
}

impl Run {
    pub(super) fn new(name: impl Into<String>, scenario: Value) -> Self {
        Self { name: name.into(), scenario, shots: Vec::new() }
    }

    /// The same run under seeds 1 to `count`.
    pub(super) fn seeds(name: &str, scenario: &Value, count: u64) -> Vec<Self> {
        (1..=count).map(|seed| Self::new(name, with(scenario, json!({"seed": seed})))).collect()
    }

    pub(super) fn shot(mut self, shot: Shot) -> Self {
        self.shots.push(shot);
        self
    }
}

/// A document with another laid over it: its fields win, objects are laid over objects.
pub(super) fn with(base: &Value, over: Value) -> Value {
    match (base, over) {
        (Value::Object(base), Value::Object(over)) => {
            let mut both = base.clone();
            for (name, value) in over {
                let below = both.get(&name).cloned().unwrap_or(Value::Null);
                both.insert(name, with(&below, value));
            }
            both.into()
        }
        (_, over) => over,
    }
}

/// The results of a figure's runs: a record each, none where the run failed.
pub(super) struct Results<'a> {
    pub(super) runs: Vec<(&'a str, Option<&'a Record>)>,
}

impl<'a> Results<'a> {
    fn named(&self, name: &str) -> impl Iterator<Item = Option<&'a Record>> {
        self.runs.iter().filter(move |(other, _)| *other == name).map(|(_, record)| *record)
    }

    /// How many runs of a name there were to be.
    pub(super) fn planned(&self, name: &str) -> usize {
        self.named(name).count()
    }

    /// All runs of a name, by seed, those that diverged too; those that failed are not there.
    pub(super) fn any(&self, name: &str) -> Vec<&'a Record> {
        self.named(name).flatten().collect()
    }

    /// All sound runs of a name, by seed.
    pub(super) fn of(&self, name: &str) -> Vec<&'a Record> {
        self.named(name).flatten().filter(|record| record.is_sound()).collect()
    }

    /// The first sound run of a name.
    pub(super) fn first(&self, name: &str) -> Option<&'a Record> {
        self.of(name).first().copied()
    }

    /// Something of all sound runs of a name, as far as they have it.
    pub(super) fn seeds_of(&self, name: &str, value: impl Fn(&Record) -> Option<f64>) -> Seeds {
        let values = self.of(name).into_iter().filter_map(value);
        Seeds { values: values.collect(), planned: self.planned(name) }
    }

    /// A response of all sound runs of a name that reached it.
    pub(super) fn seeds(&self, name: &str, response: &str) -> Seeds {
        self.seeds_of(name, |record| record.response(response))
    }

    /// A response of the first sound run of a name.
    pub(super) fn value(&self, name: &str, response: &str) -> Option<f64> {
        self.first(name)?.response(response)
    }
}

/// What a figure tells.
#[derive(Clone, Debug, Default)]
pub(super) struct Told {
    pub(super) rows: Vec<Row>,
    pub(super) illustrations: Vec<Illustration>,
    /// What does not reproduce and why, or what else there is to know, in plain words.
    pub(super) findings: Vec<String>,
}

/// A plot or a picture.
#[derive(Clone, Debug)]
pub(super) struct Illustration {
    pub(super) svg: String,
    pub(super) caption: String,
}

impl Illustration {
    pub(super) fn new(svg: String, caption: impl Into<String>) -> Self {
        Self { svg, caption: caption.into() }
    }
}

/// The figures' runs as tasks, each once however many figures want it.
pub(super) struct Plan {
    pub(super) figures: Vec<Figure>,
    pub(super) tasks: Vec<Task>,
    /// For each figure, the tasks of its runs in their order.
    pub(super) uses: Vec<Vec<usize>>,
}

impl Plan {
    /// # Errors
    /// A scenario of ours that the solver refuses.
    pub(super) fn new(figures: Vec<Figure>) -> Result<Self> {
        let mut known = HashMap::new();
        let mut plan = Self { figures, tasks: Vec::new(), uses: Vec::new() };
        for figure in &plan.figures {
            let mut used = Vec::new();
            for run in &figure.runs {
                let task = task(run).map_err(|faults| anyhow!("{}, {}: {faults}", figure.name, run.name))?;
                let index = *known.entry(task.digest.clone()).or_insert_with(|| {
                    plan.tasks.push(task);
                    plan.tasks.len() - 1
                });
                let missing = run.shots.iter().filter(|shot| !plan.tasks[index].shots.contains(shot));
                let missing = missing.copied().collect::<Vec<_>>();
                plan.tasks[index].shots.extend(missing);
                used.push(index);
            }
            plan.uses.push(used);
        }
        Ok(plan)
    }

    /// The tasks in the order in which they are to start: figure by figure, the longest of each first.
    pub(super) fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = Vec::new();
        for used in &self.uses {
            let mut fresh: Vec<usize> = used.iter().copied().filter(|index| !order.contains(index)).collect();
            fresh.sort_by(|a, b| self.tasks[*b].cost.total_cmp(&self.tasks[*a].cost).then(a.cmp(b)));
            fresh.dedup();
            order.extend(fresh);
        }
        order
    }
}

fn task(run: &Run) -> Result<Task, String> {
    let list =
        |faults: Vec<scenario::Fault>| faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
    let scenario = scenario::from_value(&run.scenario).map_err(list)?;
    let checked = check(&scenario, &Meshes::default(), &Limits::NONE).map_err(list)?;
    let estimate = checked.estimate();
    Ok(Task { digest: scenario.digest(), shots: run.shots.clone(), cost: estimate.wall_s, checked })
}

#[cfg(test)]
mod tests {
    use super::super::figures;
    use super::super::picture::When;
    use super::super::profile::PROFILES;
    use super::*;

    #[test]
    fn every_run_of_every_profile_is_sound_and_named_once_a_seed() {
        for profile in PROFILES {
            let figures = figures::all(profile);
            for figure in &figures {
                let mut named: Vec<_> =
                    figure.runs.iter().map(|run| (&run.name, run.scenario.to_string())).collect();
                named.sort();
                named.dedup();
                assert_eq!(named.len(), figure.runs.len(), "{} of {}", figure.name, profile.name);
            }
            let plan = Plan::new(figures).unwrap_or_else(|error| panic!("{}: {error:#}", profile.name));
            let mut order = plan.order();
            order.sort_unstable();
            assert_eq!(order, (0..plan.tasks.len()).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_run_that_two_figures_want_is_one_task_with_the_pictures_of_both() {
        let scenario = json!({"experiment": "hopper", "product": {"count": 2}});
        let run = |when| Run::new("same", scenario.clone()).shot(Shot::side(when));
        let figure = |runs| Figure {
            name: "Fig. 1",
            title: "",
            part: Part::Hopper,
            paper: "",
            runs,
            tell: |_, _| Told::default(),
        };
        let other = Run::new("other", with(&scenario, json!({"product": {"count": 3}})));
        let plan =
            Plan::new(vec![figure(vec![run(When::First)]), figure(vec![other, run(When::Last)])]).unwrap();
        assert_eq!(plan.uses, [vec![0], vec![1, 0]]);
        assert_eq!(plan.tasks[0].shots, [Shot::side(When::First), Shot::side(When::Last)]);
        assert_eq!(plan.order(), [0, 1]);
    }

    #[test]
    fn laying_a_document_over_another_keeps_what_it_does_not_name() {
        let base = json!({"a": {"b": 1, "c": 2}, "d": 3});
        assert_eq!(
            with(&base, json!({"a": {"b": 9}, "e": 4})),
            json!({"a": {"b": 9, "c": 2}, "d": 3, "e": 4})
        );
    }
}
