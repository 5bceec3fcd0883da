//! Finished work on disk until the server has it: a crash of either side loses nothing.
//!
//! One folder a server: what one server knows nothing of must wait for the other. In it, one file a delivery, named
//! by job and attempt, written beside and renamed into place after an fsync, so that
//! a file is whole or not there; beside it, a folder with its frames. Only the server's word removes one: 2xx (it has it), or 409 (another attempt
//! counts). What it refuses because of the token (401, 403) waits for another; what the server refuses for another reason is set aside in `refused/`, where a person can look at it,
//! and the attempt reported as failed: a job whose result nobody takes is not run over and over. Workers may share a directory: deliveries are safe to repeat.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::AttemptOutcome;
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
    /// The frames that lie beside it, which go ahead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<Recorded>,
}

/// What a stream of frames beside a delivery holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recorded {
    /// Frames.
    pub count: u64,
    /// Why they end before the run did.
    pub stopped: Option<String>,
}

/// Extension of the folder beside a delivery that its frames lie in.
pub(crate) const FRAMES: &str = "frames";

/// A result, or why there is none.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Content {
    /// The job's result.
    Result(ResultDelivery),
    /// The attempt ended without it.
    Failure(FailureReport),
}

impl Content {
    /// Whose it is.
    pub fn worker_id(&self) -> WorkerId {
        match self {
            Self::Result(body) => body.worker_id,
            Self::Failure(body) => body.worker_id,
        }
    }
}

/// What became of a delivery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// The server has it.
    Confirmed,
    /// The server will never take it: the attempt is stale.
    Refused,
}

impl Delivery {
    /// Sends it once.
    ///
    /// # Errors
    /// Any answer other than "I have it" (2xx) and "the attempt is stale" (409).
    pub async fn send(&self, client: &Client) -> Result<Fate, ClientError> {
        let sent = match &self.content {
            Content::Result(body) => client.deliver_result(self.job_id, self.attempt, body).await,
            Content::Failure(body) => client.report_failure(self.job_id, self.attempt, body).await,
        };
        match sent {
            Ok(()) => Ok(Fate::Confirmed),
            Err(error) if matches!(error.problem_status(), Some(409)) => {
                tracing::warn!(job = %self.job_id, attempt = self.attempt, %error, "the server refused a delivery");
                Ok(Fate::Refused)
            }
            Err(error) => Err(error),
        }
    }

    /// What to tell the server in place of a delivery whose content it refuses: that the attempt failed, and why. None
    /// when the refusal is not about the content, or there is nothing left to leave out.
    pub fn instead(self, refusal: &ClientError) -> Option<Self> {
        if !matches!(refusal.problem_status(), Some(400 | 413 | 422)) {
            return None;
        }
        let report = match self.content {
            Content::Result(ResultDelivery { worker_id, .. }) => FailureReport {
                worker_id,
                outcome: AttemptOutcome::Worker,
                message: format!("the server refused the result: {refusal}"),
                result: None,
            },
            Content::Failure(report) if report.result.is_some() => FailureReport {
                message: format!("{} (the server refused the partial result: {refusal})", report.message),
                result: None,
                ..report
            },
            Content::Failure(_) => return None,
        };
        Some(Self { content: Content::Failure(report), frames: None, ..self })
    }
}

/// A directory of deliveries.
#[derive(Clone, Debug)]
pub struct Outbox {
    folder: PathBuf,
}

impl Outbox {
    /// Opens the outbox for one server in a worker's state directory, making it if need be. The key names the
    /// server, such as its address.
    pub fn open(state_dir: &Path, key: &str) -> io::Result<Self> {
        let folder = state_dir.join("outbox").join(folder_name(key));
        fs::create_dir_all(folder.join("refused"))?;
        remove_abandoned(&folder)?;
        remove_abandoned_frames(&folder)?;
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

    /// Where the frames of an attempt lie: beside its delivery, before there is one.
    pub fn frames_folder(&self, job_id: JobId, attempt: u32) -> PathBuf {
        self.folder.join(format!("{job_id}-{attempt}.{FRAMES}"))
    }

    /// Where the deliveries that wait are, oldest job first. Only paths: results are large, and there may be many.
    pub fn waiting(&self) -> io::Result<Vec<PathBuf>> {
        let mut paths: Vec<_> = fs::read_dir(&self.folder)?
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<io::Result<_>>()?;
        paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
        paths.sort();
        Ok(paths)
    }

    /// One delivery; none when a neighbour has delivered it meanwhile. A file that makes no sense is set aside.
    pub fn read(&self, path: &Path) -> io::Result<Option<Delivery>> {
        let bytes = match fs::read(path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error),
        };
        match serde_json::from_slice(&bytes) {
            Ok(delivery) => Ok(Some(delivery)),
            Err(error) => {
                tracing::error!(path = %path.display(), %error, "set aside an unreadable delivery");
                self.set_aside(path)?;
                Ok(None)
            }
        }
    }

    /// Forgets a delivery that the server has, or will never take.
    pub fn remove(&self, path: &Path) -> io::Result<()> {
        missing_is_fine(fs::remove_file(path))?;
        missing_is_fine(fs::remove_dir_all(path.with_extension(FRAMES)))?;
        self.sync_folder()
    }

    /// Moves a delivery out of the way, for a person to look at.
    pub fn set_aside(&self, path: &Path) -> io::Result<()> {
        let name = path.file_name().unwrap_or_default();
        missing_is_fine(fs::rename(path, self.folder.join("refused").join(name)))?;
        missing_is_fine(fs::remove_dir_all(path.with_extension(FRAMES)))?;
        self.sync_folder()
    }

    fn sync_folder(&self) -> io::Result<()> {
        File::open(&self.folder)?.sync_all()
    }
}

/// A server's address as the name of a folder: no two addresses share one.
fn folder_name(key: &str) -> String {
    let address = key.strip_prefix("http://").unwrap_or(key).trim_end_matches('/');
    let mut name = String::with_capacity(address.len());
    for byte in address.bytes() {
        match byte {
            b'.' if name.is_empty() => name.push_str("%2e"), // neither hidden nor `..`
            b'.' | b'-' | b'0'..=b'9' | b'a'..=b'z' => name.push(byte.into()),
            b'A'..=b'Z' => name.push(byte.to_ascii_lowercase().into()),
            b':' => name.push('_'),
            other => name.push_str(&format!("%{other:02x}")),
        }
    }
    name
}

fn missing_is_fine(outcome: io::Result<()>) -> io::Result<()> {
    match outcome {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        outcome => outcome,
    }
}

/// Removes frames that no delivery waits with and that nobody is adding to any more.
fn remove_abandoned_frames(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let is_frames = path.extension().is_some_and(|extension| extension == FRAMES);
        if !is_frames || path.with_extension("json").exists() {
            continue;
        }
        let changed = |path: &Path| fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
        let newest = changed(&path.join(roost_frames::STREAM)).or_else(|| changed(&path));
        let age = newest.map(|then| SystemTime::now().duration_since(then).unwrap_or_default());
        if age.is_some_and(|age| age > ABANDONED_AFTER) {
            missing_is_fine(fs::remove_dir_all(path))?;
        }
    }
    Ok(())
}

/// Removes what nobody is writing any more.
pub(crate) fn remove_abandoned(folder: &Path) -> io::Result<()> {
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
