//! Unit and meaning of each column of a result table.

use roost_api::quantity::Quantity;
use roost_solver::experiments::{Outputs, ResponseDefinition, ResponseType, all_responses, outputs_of};
use roost_solver::scenario::fields;

/// Columns that every table has, and their meanings.
const COMMON: [(&str, &str); 12] = [
    ("job_id", "Identifier of the job."),
    ("point", "Index of the design point, from 0 on."),
    ("replicate", "Number of the replicate."),
    ("seed", "Seed of all random numbers of the job."),
    ("state", "State of the job: queued, running, succeeded, failed or cancelled."),
    ("failure_class", "Why the job has failed; empty for all others."),
    ("backend", "Backend that computed the result."),
    ("solver_revision", "Revision of the solver that computed the result."),
    ("trials", "Number of jobs of the design point."),
    ("succeeded", "Number of jobs of the design point that have succeeded."),
    ("failed", "Number of jobs of the design point that have failed."),
    ("unstable", "Number of failed jobs whose simulation became unstable."),
];

/// Ends of the names of a response's columns over replicates, and their meanings.
const SUMMARIES: [(&str, &str); 8] = [
    ("n", "Number of succeeded jobs with a value."),
    ("mean", "Mean over the succeeded jobs."),
    ("standard_deviation", "Standard deviation of single jobs."),
    ("low_95", "Lower end of the 95 % interval of the mean."),
    ("high_95", "Upper end of the 95 % interval of the mean."),
    ("input_deviation", "Standard deviation that comes from the parameters drawn from a posterior."),
    ("chance_deviation", "Standard deviation of jobs with the same parameters."),
    ("words", "Number of succeeded jobs with each value, as JSON."),
];

/// The unit of a column and its meaning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ColumnUnit {
    /// The unit; empty without one.
    pub(crate) unit: String,
    /// The meaning in one or two sentences; empty for a response that no experiment has any more.
    pub(crate) meaning: String,
}

/// The unit and the meaning of a column, by its long name. The results of another experiment than `experiment` are looked up in all of them.
pub(crate) fn unit_of(column: &str, experiment: Option<&str>) -> ColumnUnit {
    if column.starts_with('/') {
        let list = column.rsplit_once('/').map_or("", |(list, _)| list);
        let field = fields::find(column).or_else(|| fields::find(list));
        let meaning = field.map_or("", |field| field.doc).to_owned();
        return ColumnUnit { unit: Quantity::of_field(column).unit, meaning };
    }
    if let Some((_, meaning)) = COMMON.iter().find(|(name, _)| *name == column) {
        return ColumnUnit { unit: String::new(), meaning: (*meaning).to_owned() };
    }
    let outputs = experiment.and_then(outputs_of);
    let unit =
        |response: Option<ResponseDefinition>| response.map_or("", |response| response.unit).to_owned();
    let doc = |response: Option<ResponseDefinition>| response.map_or("", |response| response.doc);
    let summary = column.rsplit_once('.').and_then(|(name, end)| {
        SUMMARIES.iter().find(|(known, _)| *known == end).map(|(_, meaning)| (name, end, *meaning))
    });
    let Some((name, end, meaning)) = summary else {
        let response = response_of(column, outputs);
        return ColumnUnit { unit: unit(response), meaning: doc(response).to_owned() };
    };
    let response = response_of(name, outputs);
    let is_share = response.is_some_and(|response| response.kind == ResponseType::Indicator);
    let meaning = if is_share && end == "mean" { "Share of the succeeded jobs with 1." } else { meaning };
    let unit = if ["n", "words"].contains(&end) { String::new() } else { unit(response) };
    ColumnUnit { unit, meaning: format!("{meaning} {}", doc(response)).trim_end().to_owned() }
}

/// Sorts responses: those of short tables first, in the order of the table of responses, then the others as they are.
pub(crate) fn headline_first(responses: &mut [super::SweepResponse], experiment: Option<&str>) {
    let outputs = experiment.and_then(outputs_of);
    let rank = |response: &super::SweepResponse| {
        let own =
            outputs.and_then(|outputs| outputs.responses.iter().position(|row| row.name == response.name));
        let is_headline = response_of(&response.name, outputs).is_some_and(|row| row.headline);
        (!is_headline, if is_headline { own } else { None })
    };
    responses.sort_by_key(rank);
}

/// The response of a name in an experiment, or else in any.
fn response_of(name: &str, outputs: Option<&'static Outputs>) -> Option<ResponseDefinition> {
    let own = outputs.and_then(|outputs| outputs.responses.iter().find(|row| row.name == name).copied());
    own.or_else(|| {
        all_responses().into_iter().find(|shared| shared.row.name == name).map(|shared| shared.row)
    })
}
