//! Finished work on disk until the server has it: a crash of either side loses nothing.
//!
//! One file a delivery, named by job and attempt, written beside and renamed into place after an fsync, so that
//! a file is whole or not there. Only the server's word removes one: 2xx (it has it), or 409 and 422 (it
//! will never take it). What the server refuses for another reason is set aside in `refused/`, where a person
//! can look at it. Workers may share a directory: deliveries are safe to repeat.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use roost_api::ids::JobId;
use roost_api::lease::{FailureReport, ResultDelivery};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::client::{Client, ClientError};

/// Half-written files older than this belong to nobody any more.
const ABANDONED_AFTER: Duration = Duration::from_secs(24 * 3600);

/// What an attempt has to tell the server.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Delivery {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
    /// What to deliver.
    pub content: Content,
}

/// A result, or why there is none.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Content {
    /// The job's result.
    Result(ResultDelivery),
    /// The attempt ended without it.
    Failure(FailureReport),
}

/// What became of a delivery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// The server has it.
    Confirmed,
    /// The server will never take it: the attempt is stale or the document unacceptable.
    Refused,
}

impl Delivery {
    /// Sends it once.
    ///
    /// # Errors
    /// Any answer other than "I have it" (2xx) and "I will never take it" (409, 422).
    pub async fn send(&self, client: &Client) -> Result<Fate, ClientError> {
        let sent = match &self.content {
            Content::Result(body) => client.deliver_result(self.job_id, self.attempt, body).await,
            Content::Failure(body) => client.report_failure(self.job_id, self.attempt, body).await,
        };
        match sent {
            Ok(()) => Ok(Fate::Confirmed),
            Err(error) if matches!(error.problem_status(), Some(409 | 422)) => {
                tracing::warn!(job = %self.job_id, attempt = self.attempt, %error, "the server refused a delivery");
                Ok(Fate::Refused)
            }
            Err(error) => Err(error),
        }
    }
}

/// A directory of deliveries.
#[derive(Clone, Debug)]
pub struct Outbox {
    folder: PathBuf,
}

impl Outbox {
    /// Opens the outbox in a worker's state directory, making it if need be.
    pub fn open(state_dir: &Path) -> io::Result<Self> {
        let folder = state_dir.join("outbox");
        fs::create_dir_all(folder.join("refused"))?;
        remove_abandoned(&folder)?;
        Ok(Self { folder })
    }

    /// Writes a delivery so that it survives a crash from here on, and says where.
    pub fn put(&self, delivery: &Delivery) -> io::Result<PathBuf> {
        let path = self.folder.join(format!("{}-{}.json", delivery.job_id, delivery.attempt));
        let beside = self.folder.join(format!("{}.tmp", Uuid::now_v7()));
        let mut file = File::create_new(&beside)?;
        file.write_all(&serde_json::to_vec(delivery)?)?;
        file.sync_all()?;
        fs::rename(&beside, &path)?;
        self.sync_folder()?;
        Ok(path)
    }

    /// Every delivery that waits, oldest job first. A file that cannot be read is set aside.
    pub fn waiting(&self) -> io::Result<Vec<(PathBuf, Delivery)>> {
        let mut paths: Vec<_> = fs::read_dir(&self.folder)?
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<io::Result<_>>()?;
        paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
        paths.sort();
        let mut deliveries = Vec::with_capacity(paths.len());
        for path in paths {
            let bytes = match fs::read(&path) {
                Ok(bytes) => bytes,
                Err(error) if error.kind() == ErrorKind::NotFound => continue, // delivered by a neighbour
                Err(error) => return Err(error),
            };
            match serde_json::from_slice(&bytes) {
                Ok(delivery) => deliveries.push((path, delivery)),
                Err(error) => {
                    tracing::error!(path = %path.display(), %error, "set aside an unreadable delivery");
                    self.set_aside(&path)?;
                }
            }
        }
        Ok(deliveries)
    }

    /// Forgets a delivery that the server has, or will never take.
    pub fn remove(&self, path: &Path) -> io::Result<()> {
        missing_is_fine(fs::remove_file(path))?;
        self.sync_folder()
    }

    /// Moves a delivery out of the way, for a person to look at.
    pub fn set_aside(&self, path: &Path) -> io::Result<()> {
        let name = path.file_name().unwrap_or_default();
        missing_is_fine(fs::rename(path, self.folder.join("refused").join(name)))?;
        self.sync_folder()
    }

    fn sync_folder(&self) -> io::Result<()> {
        File::open(&self.folder)?.sync_all()
    }
}

fn missing_is_fine(outcome: io::Result<()>) -> io::Result<()> {
    match outcome {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        outcome => outcome,
    }
}

fn remove_abandoned(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let is_half_written = entry.path().extension().is_some_and(|extension| extension == "tmp");
        let Ok(modified) = entry.metadata().and_then(|metadata| metadata.modified()) else { continue };
        let age = SystemTime::now().duration_since(modified).unwrap_or_default();
        if is_half_written && age > ABANDONED_AFTER {
            missing_is_fine(fs::remove_file(entry.path()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
