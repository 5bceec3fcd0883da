//! `roost study watch`: follows a study to its end, with a progress bar.

use anyhow::Result;
use roost_api::ids::SweepId;
use roost_api::study::{StudyState, StudyView};
use roost_terminal::progress::Bar;
use roost_terminal::{Exit, signals};
use roost_worker::client::Client;
use tokio_util::sync::CancellationToken;

use super::show;
use crate::{target, watch};

/// Show the progress of a study until its end, and print its answer
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a study
    #[arg(value_parser = target::study_id)]
    id: SweepId,
    #[command(flatten)]
    server: target::Server,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let client = args.server.client()?;
    let study = follow(&client, args.id, &signals::shutdown_token()?).await?;
    show::print(&study, false)?;
    Ok(exit_of(&study))
}

/// Follows a study until it is finished or cancelled. A signal ends only the waiting.
pub(super) async fn follow(client: &Client, id: SweepId, shutdown: &CancellationToken) -> Result<StudyView> {
    let mut bar = Bar::new("study");
    let mut forecasts = watch::Forecasts::default();
    loop {
        let study = watch::retrying(|| client.study(id), shutdown).await?;
        let fraction = fraction(&study);
        if matches!(study.state, StudyState::Finished | StudyState::Cancelled) {
            bar.finish(fraction, &show::runs(&study));
            return Ok(study);
        }
        let ends = forecasts.next(|| client.study_forecast(id)).await;
        bar.update(fraction, &progress(&study, ends));
        watch::pause(shutdown).await?;
    }
}

/// Number of runs that have ended.
fn ended(study: &StudyView) -> u64 {
    study.runs.done + study.runs.failed + study.runs.cancelled
}

/// Share of the budget that is spent.
fn fraction(study: &StudyView) -> f64 {
    ended(study) as f64 / study.runs.max_runs.max(1) as f64
}

/// One line about a study: its runs, the forecast of its end as ` · …`, the answer so far.
fn progress(study: &StudyView, ends: &str) -> String {
    let mut parts =
        vec![format!("{}{}", show::runs(study), if study.state == StudyState::Paused { "" } else { ends })];
    if study.state == StudyState::Paused {
        parts.push("paused".to_owned());
    }
    parts.extend(study.answer.first().cloned());
    parts.join(" · ")
}

/// The exit code of a study: success if it has ended with an answer.
pub(super) fn exit_of(study: &StudyView) -> Exit {
    let evidence = study.runs.done + study.runs.outside_budget;
    if study.state == StudyState::Finished && evidence > 0 { Exit::Done } else { Exit::Failed }
}

#[cfg(test)]
mod tests {
    use super::show::tests::view;
    use super::*;

    #[test]
    fn progress_has_runs_the_end_and_the_answer_so_far() {
        let mut study = view(40, 8, 200);
        assert_eq!(progress(&study, ""), "40 of 200 runs, 8 pending");
        study.answer = vec!["The boundary is at 52 mm.".to_owned(), "And more.".to_owned()];
        let expected = "40 of 200 runs, 8 pending · ends in 0 s to 1:20 · The boundary is at 52 mm.";
        assert_eq!(progress(&study, " · ends in 0 s to 1:20"), expected);
        assert_eq!(fraction(&study), 0.2);
        study.state = StudyState::Paused;
        let expected = "40 of 200 runs, 8 pending · paused · The boundary is at 52 mm.";
        assert_eq!(progress(&study, " · ends in 1:20"), expected);
    }

    #[test]
    fn failed_runs_count_against_the_budget() {
        let mut study = view(40, 0, 100);
        study.runs.failed = 10;
        assert_eq!(fraction(&study), 0.5);
    }

    #[test]
    fn study_without_an_answer_has_failed() {
        let mut study = view(3, 0, 3);
        assert_eq!(exit_of(&study), Exit::Failed, "it still runs");
        study.state = StudyState::Finished;
        assert_eq!(exit_of(&study), Exit::Done);
        study.runs.done = 0;
        assert_eq!(exit_of(&study), Exit::Failed);
        study.runs.outside_budget = 40;
        assert_eq!(exit_of(&study), Exit::Done, "runs of a sweep can answer alone");
    }
}
