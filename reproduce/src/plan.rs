//! The plan of a report: figures, each with named simulations and a pure function that evaluates their results.

use std::collections::HashMap;

use anyhow::{Result, anyhow};
use clap::ValueEnum;
use roost_solver::mesh::Meshes;
use roost_solver::{Limits, check, scenario};
use roost_stats::ReplicateValues;
use serde_json::{Value, json};

use crate::picture::Shot;
use crate::profile::Profile;
use crate::record::Record;
use crate::row::Row;
use crate::scheduler::Task;

/// A part of the report, as the command line names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Part {
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
    /// Bulk discharge (Fig. 13 and 14, Table 3) and the check of the time step
    Hopper,
}

/// A figure or table of the paper.
pub(crate) struct Figure {
    /// Its name in the paper, such as `Fig. 9`.
    pub(crate) name: &'static str,
    pub(crate) title: &'static str,
    pub(crate) part: Part,
    /// Summary of the paper's statements, with its numbers.
    pub(crate) paper: &'static str,
    pub(crate) runs: Vec<Run>,
    /// Evaluates the results of the runs.
    pub(crate) evaluate: fn(&Profile, &Results<'_>) -> Evaluation,
}

/// A simulation that a figure needs.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    /// Replicates, which differ only in their seed, share a name.
    pub(crate) name: String,
    pub(crate) scenario: Value,
    pub(crate) shots: Vec<Shot>,
}

impl Run {
    pub(crate) fn new(name: impl Into<String>, scenario: Value) -> Self {
        Self { name: name.into(), scenario, shots: Vec::new() }
    }

    /// Replicates of a run, with seeds 1 to `count`.
    pub(crate) fn replicates(name: &str, scenario: &Value, count: u64) -> Vec<Self> {
        (1..=count).map(|seed| Self::new(name, with(scenario, json!({"seed": seed})))).collect()
    }

    /// Requests a picture.
    pub(crate) fn shot(mut self, shot: Shot) -> Self {
        self.shots.push(shot);
        self
    }
}

/// A document with the fields of another one merged into it, recursively.
pub(crate) fn with(base: &Value, over: Value) -> Value {
    match (base, over) {
        (Value::Object(base), Value::Object(over)) => {
            let mut merged = base.clone();
            for (name, value) in over {
                let below = merged.get(&name).cloned().unwrap_or(Value::Null);
                merged.insert(name, with(&below, value));
            }
            merged.into()
        }
        (_, over) => over,
    }
}

/// The results of a figure's runs: name and record of each, without a record if the run failed.
pub(crate) struct Results<'a> {
    pub(crate) runs: Vec<(&'a str, Option<&'a Record>)>,
}

impl<'a> Results<'a> {
    fn named(&self, name: &str) -> impl Iterator<Item = Option<&'a Record>> {
        self.runs.iter().filter(move |(other, _)| *other == name).map(|(_, record)| *record)
    }

    /// Number of planned runs of a name.
    pub(crate) fn planned(&self, name: &str) -> usize {
        self.named(name).count()
    }

    /// Records of a name in the order of seeds, including those of diverged runs.
    pub(crate) fn records(&self, name: &str) -> Vec<&'a Record> {
        self.named(name).flatten().collect()
    }

    /// Records of the sound runs of a name, in the order of seeds.
    pub(crate) fn sound_records(&self, name: &str) -> Vec<&'a Record> {
        self.named(name).flatten().filter(|record| record.is_sound()).collect()
    }

    /// Record of the first sound run of a name.
    pub(crate) fn first_record(&self, name: &str) -> Option<&'a Record> {
        self.sound_records(name).first().copied()
    }

    /// A value of every sound run of a name that has it.
    pub(crate) fn values(&self, name: &str, value: impl Fn(&Record) -> Option<f64>) -> ReplicateValues {
        let values = self.sound_records(name).into_iter().filter_map(value);
        ReplicateValues { values: values.collect(), planned: self.planned(name) }
    }

    /// A response of every sound run of a name that has it.
    pub(crate) fn response(&self, name: &str, response: &str) -> ReplicateValues {
        self.values(name, |record| record.response(response))
    }

    /// A response of the first sound run of a name.
    pub(crate) fn first_response(&self, name: &str, response: &str) -> Option<f64> {
        self.first_record(name)?.response(response)
    }
}

/// The evaluation of a figure.
#[derive(Clone, Debug, Default)]
pub(crate) struct Evaluation {
    pub(crate) rows: Vec<Row>,
    pub(crate) illustrations: Vec<Illustration>,
    /// Statements on values that do not reproduce, and on assumptions.
    pub(crate) findings: Vec<String>,
}

/// A plot or a picture, with its caption.
#[derive(Clone, Debug)]
pub(crate) struct Illustration {
    pub(crate) svg: String,
    pub(crate) caption: String,
}

impl Illustration {
    pub(crate) fn new(svg: String, caption: impl Into<String>) -> Self {
        Self { svg, caption: caption.into() }
    }
}

/// The runs of all figures as tasks. A run that several figures use is one task.
pub(crate) struct Plan {
    pub(crate) figures: Vec<Figure>,
    pub(crate) tasks: Vec<Task>,
    /// For each figure, the indices of the tasks of its runs.
    pub(crate) uses: Vec<Vec<usize>>,
}

impl Plan {
    /// # Errors
    /// If the solver refuses a scenario.
    pub(crate) fn new(figures: Vec<Figure>) -> Result<Self> {
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

    /// Indices of the tasks in the order of their start: figure by figure, the longest first.
    pub(crate) fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = Vec::new();
        for used in &self.uses {
            let mut fresh: Vec<usize> = used.iter().copied().filter(|index| !order.contains(index)).collect();
            fresh.sort_by(|a, b| self.tasks[*b].cost_s.total_cmp(&self.tasks[*a].cost_s).then(a.cmp(b)));
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
    let cost_s = checked.estimate().wall_s;
    Ok(Task { digest: scenario.digest(), shots: run.shots.clone(), cost_s, checked })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures;
    use crate::picture::Moment;
    use crate::profile::PROFILES;

    #[test]
    fn every_run_of_every_profile_is_accepted_and_unique() {
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
    fn shared_run_is_one_task_with_the_pictures_of_both_figures() {
        let scenario = json!({"experiment": "hopper", "product": {"count": 2}});
        let run = |when| Run::new("same", scenario.clone()).shot(Shot::side(when));
        let figure = |runs| Figure {
            name: "Fig. 1",
            title: "",
            part: Part::Hopper,
            paper: "",
            runs,
            evaluate: |_, _| Evaluation::default(),
        };
        let other = Run::new("other", with(&scenario, json!({"product": {"count": 3}})));
        let plan = Plan::new(vec![figure(vec![run(Moment::First)]), figure(vec![other, run(Moment::Last)])])
            .unwrap();
        assert_eq!(plan.uses, [vec![0], vec![1, 0]]);
        assert_eq!(plan.tasks[0].shots, [Shot::side(Moment::First), Shot::side(Moment::Last)]);
        assert_eq!(plan.order(), [0, 1]);
    }

    #[test]
    fn merging_keeps_fields_that_the_other_document_does_not_name() {
        let base = json!({"a": {"b": 1, "c": 2}, "d": 3});
        assert_eq!(
            with(&base, json!({"a": {"b": 9}, "e": 4})),
            json!({"a": {"b": 9, "c": 2}, "d": 3, "e": 4})
        );
    }
}
