//! Faults of the fields of the goal.

use super::{Constraint, Optimise, confirmation};
use crate::budget::Budget;
use crate::factor::Factor;
use crate::fault::{Fault, fault};
use crate::measure::Measure;

impl Constraint {
    fn faults(&self, at: &str, faults: &mut Vec<Fault>) {
        self.of.faults(&format!("{at}/of"), faults);
        if self.at_most.is_some() == self.at_least.is_some() {
            faults.push(fault(at, self, "not one limit", "either `at_most` or `at_least`"));
        }
        let is_probability = matches!(self.of, Measure::Probability(_));
        for (name, limit) in [("at_most", self.at_most), ("at_least", self.at_least)] {
            if let Some(limit) = limit.filter(|limit| is_probability && !(0.001..=0.999).contains(limit)) {
                let at = format!("{at}/{name}");
                faults.push(fault(&at, limit, "no runs could certify it", "from 0.001 to 0.999"));
            }
        }
    }

    /// Why the limit cannot stand beside an earlier one of the same measure, and what could.
    fn conflict(&self, earlier: &Self) -> Option<(&'static str, String)> {
        // Equal limits as well: the interval of a measure does not fit between them.
        let crossed = "no runs could certify it and an earlier limit of the same measure";
        match ((self.at_most, self.at_least), (earlier.at_most, earlier.at_least)) {
            ((Some(most), None), (None, Some(least))) if least >= most => {
                Some((crossed, format!("`at_most` above {least}")))
            }
            ((None, Some(least)), (Some(most), None)) if least >= most => {
                Some((crossed, format!("`at_least` below {most}")))
            }
            ((Some(_), None), (Some(_), None)) | ((None, Some(_)), (None, Some(_))) => {
                let detail = "an earlier constraint has a limit of this kind for the same measure";
                Some((detail, "one `at_most` and one `at_least` for each measure".to_owned()))
            }
            // Without one limit it has another fault.
            _ => None,
        }
    }
}

impl Optimise {
    /// Objectives and limits that contradict or repeat an earlier one.
    pub(crate) fn contradictions(&self, at: &str, faults: &mut Vec<Fault>) {
        for (index, objective) in self.objectives.iter().enumerate() {
            if self.objectives[..index].iter().any(|other| other.measure() == objective.measure()) {
                let at = format!("{at}/objectives/{index}");
                let detail = "an earlier objective has this measure";
                faults.push(fault(&at, objective, detail, "different measures"));
            }
        }
        for (index, constraint) in self.constraints.iter().enumerate() {
            let mut of_measure = self.constraints[..index].iter().filter(|other| other.of == constraint.of);
            if let Some((detail, allowed)) = of_measure.find_map(|other| constraint.conflict(other)) {
                faults.push(fault(&format!("{at}/constraints/{index}"), constraint, detail, &allowed));
            }
        }
    }

    pub(crate) fn faults(&self, at: &str, factors: &[Factor], budget: &Budget, faults: &mut Vec<Fault>) {
        let before = faults.len();
        if !(1..=2).contains(&self.objectives.len()) {
            let at = format!("{at}/objectives");
            faults.push(fault(&at, &self.objectives, "not one objective or two", "one or two objectives"));
        }
        for (index, objective) in self.objectives.iter().enumerate() {
            let name = if objective.sign() > 0.0 { "minimise" } else { "maximise" };
            objective.measure().faults(&format!("{at}/objectives/{index}/{name}"), faults);
        }
        for (index, constraint) in self.constraints.iter().enumerate() {
            constraint.faults(&format!("{at}/constraints/{index}"), faults);
        }
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            let at = format!("{at}/tolerance");
            faults.push(fault(&at, self.tolerance, "not a share to end at", "more than 0 and less than 1"));
        }
        if self.front_points == 0 {
            faults.push(fault(&format!("{at}/front_points"), 0, "nothing to recommend", "at least 1"));
        }
        if let Some(runs) = self.confirmation_runs.filter(|runs| *runs > confirmation::MAX_RUNS) {
            let (at, allowed) =
                (format!("{at}/confirmation_runs"), format!("at most {}", confirmation::MAX_RUNS));
            faults.push(fault(&at, runs, "too many runs at one point", &allowed));
        }
        let limit = sobol_burley::NUM_DIMENSIONS as usize;
        if factors.len() > limit {
            let allowed = format!("at most {limit} factors with this goal");
            faults.push(fault("/factors", factors.len(), "too many factors for the search", &allowed));
        }
        if faults.len() > before {
            return;
        }
        let Some(plan) = self.plan(1) else {
            let least = (1..confirmation::MAX_RUNS)
                .find(|runs| Self { confirmation_runs: Some(*runs), ..self.clone() }.plan(1).is_some());
            let allowed = format!("at least {}", least.unwrap_or_default());
            let detail = "these runs cannot certify the constraints even in the best case";
            faults.push(fault(&format!("{at}/confirmation_runs"), self.confirmation_runs, detail, &allowed));
            return;
        };
        let least = 2 * (factors.len() + 1) + self.reserve(&plan);
        if budget.max_runs < least {
            let detail = "no room for a search and a confirmation";
            faults.push(fault("/budget/max_runs", budget.max_runs, detail, &format!("at least {least}")));
        }
    }
}
