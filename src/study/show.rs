//! `roost study show` and `roost study list`.

use anyhow::Result;
use roost_api::ids::SweepId;
use roost_api::study::{StudyEnd, StudyState, StudyView};
use roost_terminal::{Exit, Table, message, print_json, print_line, print_lines};
use serde_json::json;

use crate::{forecast, target};

/// Number of studies of a page.
const PAGE: u32 = 100;

/// Show the question, the state and the present answer of a study in words
#[derive(Debug, clap::Args)]
pub(crate) struct Show {
    /// Id of a study
    #[arg(value_parser = target::study_id)]
    id: SweepId,
    #[command(flatten)]
    server: target::Server,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// List the newest 100 studies
#[derive(Debug, clap::Args)]
pub(crate) struct List {
    #[command(flatten)]
    server: target::Server,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn show(args: Show) -> Result<Exit> {
    let client = args.server.client()?;
    let study = client.study(args.id).await?;
    print(&study, args.json)?;
    if !args.json && matches!(study.state, StudyState::Running | StudyState::Paused) {
        for line in forecast::lines(&client.study_forecast(args.id).await?) {
            print_line(line)?;
        }
    }
    Ok(Exit::Done)
}

pub(crate) async fn list(args: List) -> Result<Exit> {
    let page = args.server.client()?.studies(None, PAGE).await?;
    if args.json {
        print_json(&json!(page))?;
    } else if page.items.is_empty() {
        message!("nothing to list; `roost study submit` submits a study");
    } else {
        print_lines(table(&page.items))?;
        if page.next_cursor.is_some() {
            message!("only the newest {PAGE} studies are shown");
        }
    }
    Ok(Exit::Done)
}

/// Prints a study in words, or as JSON.
pub(super) fn print(study: &StudyView, as_json: bool) -> Result<()> {
    if as_json {
        print_json(&json!(study))?;
        return Ok(());
    }
    for line in words(study) {
        print_line(line)?;
    }
    Ok(())
}

/// A study in words: name, question, answer, state.
fn words(study: &StudyView) -> Vec<String> {
    let mut lines = vec![study.name.clone(), String::new(), study.question.clone(), String::new()];
    if study.answer.is_empty() {
        lines.push("No run has a result yet.".to_owned());
    }
    lines.extend(study.answer.iter().cloned());
    lines.extend([String::new(), format!("{}: {}", state(study), runs(study))]);
    lines
}

/// The state of a study in words.
fn state(study: &StudyView) -> String {
    match (study.state, study.finished) {
        (StudyState::Finished, Some(StudyEnd::ByRule)) => "finished by its rule".to_owned(),
        (StudyState::Finished, Some(StudyEnd::ByBudget)) => "finished, budget spent".to_owned(),
        (StudyState::Finished, Some(StudyEnd::NothingLeft)) => "finished, no point left to run".to_owned(),
        (state, _) => state.to_string(),
    }
}

/// The runs of a study in words.
pub(super) fn runs(study: &StudyView) -> String {
    let runs = study.runs;
    let mut text = format!("{} of {} runs", runs.done, runs.max_runs);
    for (count, word) in [(runs.failed, "failed"), (runs.cancelled, "cancelled"), (runs.pending, "pending")] {
        if count > 0 {
            text += &format!(", {count} {word}");
        }
    }
    text
}

fn table(studies: &[StudyView]) -> Table {
    let head = ["id", "name", "state", "done", "budget", "points", "submitted", "answer"];
    let mut table = Table::new(head);
    for study in studies {
        table.row([
            study.id.to_string(),
            study.name.clone(),
            state(study),
            study.runs.done.to_string(),
            study.runs.max_runs.to_string(),
            study.points.to_string(),
            study.submitted_at.to_string(),
            study.answer.first().cloned().unwrap_or_else(|| "–".to_owned()),
        ]);
    }
    table
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A running study with these runs.
    pub(crate) fn view(done: u64, pending: u64, max_runs: u64) -> StudyView {
        let document = json!({
            "id": "01890a5d-ac96-774b-bcce-b302099a8057", "name": "gate", "state": "running", "finished": null,
            "question": "Where?", "answer": [], "factors": ["/equipment/gate_opening_m"], "points": 1,
            "runs": {"done": done, "failed": 0, "cancelled": 0, "pending": pending, "max_runs": max_runs},
            "submitted_at": "2026-01-01T00:00:00Z", "answered_at": null
        });
        serde_json::from_value(document).unwrap()
    }

    #[test]
    fn study_in_words_has_question_answer_and_state() {
        let mut study = view(0, 4, 100);
        let expected =
            ["gate", "", "Where?", "", "No run has a result yet.", "", "running: 0 of 100 runs, 4 pending"];
        assert_eq!(words(&study), expected);
        study.state = StudyState::Finished;
        study.finished = Some(StudyEnd::ByBudget);
        study.answer = vec!["Here.".to_owned(), "Perhaps.".to_owned()];
        study.runs.failed = 2;
        study.runs.pending = 0;
        let words = words(&study);
        assert_eq!(words[4..], ["Here.", "Perhaps.", "", "finished, budget spent: 0 of 100 runs, 2 failed"]);
    }
}
