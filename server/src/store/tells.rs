//! Outcomes that clients tell. A run has one outcome, also if it was handed out several times.

use std::collections::HashMap;

use roost_api::ids::SweepId;
use roost_api::time::Timestamp;

use super::columns::{Columns, to_json};
use super::database::{Connection, Row, query};
use super::observations::next_number;
use super::{Store, StoreError};
use crate::study::{ToldOutcome, ToldRun};

/// The outcome of a run in other rows than one. A run that has expired or was given back has a row for each time that it was handed out. A
/// client can also tell it by values and seed. Runs of sweeps have responses that no client tells. Without statistics SQLite prefers the
/// primary key, so that the query names its index.
pub(super) const OUTCOME_ELSEWHERE: &str =
    "SELECT state, responses FROM observations INDEXED BY observations_by_seed
     WHERE study_id = ? AND seed = ? AND levels = ? AND number <> ? AND source <> 'sweep' AND state IN ('done', 'failed') LIMIT 1";

/// A told outcome of a run that has another one.
pub(crate) struct Conflict {
    /// Its place in the request.
    pub(crate) index: usize,
    /// The outcome that the run has.
    pub(crate) known: String,
}

/// State and responses of a run, as the store has them.
#[derive(Clone, Debug, PartialEq)]
struct RowOutcome {
    state: String,
    responses: Option<String>,
}

impl RowOutcome {
    fn of(outcome: &ToldOutcome) -> Result<Self, StoreError> {
        let (state, responses) = match outcome {
            ToldOutcome::Done(responses) => ("done", Some(to_json("responses", responses)?)),
            ToldOutcome::Failed => ("failed", None),
            ToldOutcome::GivenBack => ("given_back", None),
        };
        Ok(Self { state: state.to_owned(), responses })
    }

    fn read(row: &Row) -> Result<Self, StoreError> {
        Ok(Self { state: row.column("state")?, responses: row.column("responses")? })
    }

    /// Whether it is final.
    fn is_end(&self) -> bool {
        ["done", "failed"].contains(&self.state.as_str())
    }
}

/// A stored run that a client tells about.
struct KnownRun {
    number: i64,
    outcome: RowOutcome,
    levels: String,
    seed: i64,
}

/// An outcome to be recorded: of a stored run, or of a new one with these values and this seed.
struct NewOutcome {
    number: Option<i64>,
    levels: String,
    seed: i64,
    outcome: RowOutcome,
}

impl Store {
    /// Records outcomes, and returns how many are new and how many were known. When a run has another outcome already, all such runs
    /// are returned and nothing is recorded. A finished study decides once more.
    pub(crate) async fn tell(
        &self,
        id: SweepId,
        outcomes: Vec<(ToldRun, ToldOutcome)>,
        now: Timestamp,
    ) -> Result<Result<(u64, u64), Vec<Conflict>>, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let new = match new_outcomes(tx, id, &outcomes).await? {
                        Ok(new) => new,
                        Err(conflicts) => return Ok(Err(conflicts)),
                    };
                    let counts = (new.len() as u64, (outcomes.len() - new.len()) as u64);
                    for outcome in new {
                        record(tx, id, outcome, now).await?;
                    }
                    if counts.0 > 0 {
                        let sql =
                            "UPDATE studies SET news = news + 1, changes = changes + 1, finished = NULL,
                                       state = CASE state WHEN 'finished' THEN 'running' ELSE state END
                                   WHERE sweep_id = ? AND state <> 'cancelled'";
                        query(sql).bind(id.to_string()).execute(&mut *tx).await?;
                    }
                    Ok(Ok(counts))
                })
            })
            .await
    }
}

/// Those of some outcomes that are new, or all those of runs that have another one.
async fn new_outcomes(
    tx: &mut Connection,
    id: SweepId,
    outcomes: &[(ToldRun, ToldOutcome)],
) -> Result<Result<Vec<NewOutcome>, Vec<Conflict>>, StoreError> {
    let (mut new, mut conflicts) = (Vec::new(), Vec::new());
    let mut told: HashMap<(String, i64), RowOutcome> = HashMap::new();
    for (index, (run, outcome)) in outcomes.iter().enumerate() {
        let outcome = RowOutcome::of(outcome)?;
        let row = known_run(tx, id, run).await?;
        let (number, levels, seed) = match (&row, run) {
            (Some(row), _) => (Some(row.number), row.levels.clone(), row.seed),
            (None, ToldRun::Own { levels, seed }) => (None, levels.clone(), *seed as i64),
            // Not stored: a number that was handed out is a stored row.
            (None, ToldRun::HandedOut(_)) => continue,
        };
        let known = match row {
            Some(row) if row.outcome.is_end() => Some(row.outcome),
            Some(row) if !outcome.is_end() => {
                // Given back: only a run that awaits its outcome changes.
                if row.outcome.state == "handed_out" {
                    new.push(NewOutcome { number, levels, seed, outcome });
                }
                continue;
            }
            row => {
                let here = told.get(&(levels.clone(), seed)).cloned();
                let elsewhere = match here {
                    Some(here) => Some(here),
                    None => outcome_elsewhere(tx, id, (&levels, seed), number).await?,
                };
                // Of the same outcome, a row that was handed out is recorded too: it awaits it no more.
                elsewhere.filter(|elsewhere| row.is_none() || *elsewhere != outcome)
            }
        };
        match known {
            None => {
                told.insert((levels.clone(), seed), outcome.clone());
                new.push(NewOutcome { number, levels, seed, outcome });
            }
            Some(known) if known == outcome => {}
            Some(known) => {
                conflicts.push(Conflict { index, known: known.responses.unwrap_or(known.state) });
            }
        }
    }
    Ok(if conflicts.is_empty() { Ok(new) } else { Err(conflicts) })
}

async fn known_run(tx: &mut Connection, id: SweepId, run: &ToldRun) -> Result<Option<KnownRun>, StoreError> {
    let row = match run {
        ToldRun::HandedOut(number) => {
            let sql = "SELECT number, state, responses, levels, seed FROM observations WHERE study_id = ? AND number = ?";
            query(sql).bind(id.to_string()).bind(*number as i64).fetch_optional(&mut *tx).await?
        }
        ToldRun::Own { levels, seed } => {
            let sql = "SELECT number, state, responses, levels, seed FROM observations
                       WHERE study_id = ? AND source = 'client' AND levels = ? AND seed = ?";
            let query = query(sql).bind(id.to_string()).bind(levels).bind(*seed as i64);
            query.fetch_optional(&mut *tx).await?
        }
    };
    let known = |row: Row| {
        Ok(KnownRun {
            number: row.column("number")?,
            outcome: RowOutcome::read(&row)?,
            levels: row.column("levels")?,
            seed: row.column("seed")?,
        })
    };
    row.map(known).transpose()
}

/// The outcome of the run with these values and this seed in another row than `number`.
async fn outcome_elsewhere(
    tx: &mut Connection,
    id: SweepId,
    (levels, seed): (&str, i64),
    number: Option<i64>,
) -> Result<Option<RowOutcome>, StoreError> {
    let query = query(OUTCOME_ELSEWHERE).bind(id.to_string()).bind(seed).bind(levels);
    let row = query.bind(number.unwrap_or_default()).fetch_optional(&mut *tx).await?;
    row.as_ref().map(RowOutcome::read).transpose()
}

/// Records the outcome of a run: of a stored one, or of a new one at a point of a client.
async fn record(tx: &mut Connection, id: SweepId, new: NewOutcome, now: Timestamp) -> Result<(), StoreError> {
    let NewOutcome { number, levels, seed, outcome: RowOutcome { state, responses } } = new;
    if let Some(number) = number {
        let sql = "UPDATE observations SET state = ?, responses = ?, recorded_at = ?
                   WHERE study_id = ? AND number = ?";
        let query = query(sql).bind(state).bind(responses).bind(now.0);
        query.bind(id.to_string()).bind(number).execute(&mut *tx).await?;
        return Ok(());
    }
    let sql = "INSERT INTO observations (study_id, number, source, state, levels, replicate, seed, responses, recorded_at)
               VALUES (?, ?, 'client', ?, ?, 0, ?, ?, ?)";
    query(sql)
        .bind(id.to_string())
        .bind(next_number(tx, id).await?)
        .bind(state)
        .bind(levels)
        .bind(seed)
        .bind(responses)
        .bind(now.0)
        .execute(&mut *tx)
        .await?;
    Ok(())
}
