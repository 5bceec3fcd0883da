//! Finished results on disk until the server has confirmed them: a crash of either side loses nothing.
//!
//! Each server has its own folder, with a file for each delivery, named by job and attempt, and beside it a folder with its frames. A file is
//! renamed into place after an fsync, so that it is always complete. The answer of the server decides what happens to it:
//!
//! | answer | delivery |
//! |---|---|
//! | 2xx (recorded), 409 (stale attempt) | is removed |
//! | 401, 403 (token) | waits for another token |
//! | 400, 413, 422 (content) | moves to `refused/` for a person to inspect, and the attempt is reported as failed: the job does not run again and again |
//! | 404 and other refusals | moves to `refused/` |
//! | 429, 5xx or no answer | waits |
//!
//! Workers may share a directory, since deliveries are safe to repeat.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::AttemptOutcome;
use roost_api::lease::{FailureReport, ResultDelivery};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::client::{Client, ClientError, RecordedFrames};

/// No worker is still writing a temporary file older than this.
const ABANDONED_AFTER: Duration = Duration::from_secs(24 * 3600);

/// The outcome of an attempt, for the server.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Delivery {
    /// The job.
    pub job_id: JobId,
    /// Number of the attempt.
    pub attempt: u32,
    /// Result or failure.
    pub content: Content,
    /// Frames in the folder beside it, which are uploaded first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<RecordedFrames>,
}

/// Extension of the folder with the frames of a delivery.
pub(crate) const FRAMES_EXTENSION: &str = "frames";

/// A result, or the reason why there is none.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Content {
    /// The job's result.
    Result(ResultDelivery),
    /// The attempt ended without a result.
    Failure(FailureReport),
}

impl Content {
    /// The worker of the attempt.
    pub fn worker_id(&self) -> WorkerId {
        match self {
            Self::Result(body) => body.worker_id,
            Self::Failure(body) => body.worker_id,
        }
    }
}

/// The server's answer to a delivery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeliveryOutcome {
    /// The server has recorded it.
    Confirmed,
    /// The attempt is stale: the server will never record it.
    Stale,
}

impl Delivery {
    /// Sends it once.
    ///
    /// # Errors
    /// Any answer but 2xx and 409.
    pub async fn send(&self, client: &Client) -> Result<DeliveryOutcome, ClientError> {
        let sent = match &self.content {
            Content::Result(body) => client.deliver_result(self.job_id, self.attempt, body).await,
            Content::Failure(body) => client.report_failure(self.job_id, self.attempt, body).await,
        };
        self.outcome(sent)
    }

    /// The outcome by the server's answer.
    pub(crate) fn outcome(&self, answer: Result<(), ClientError>) -> Result<DeliveryOutcome, ClientError> {
        match answer {
            Ok(()) => Ok(DeliveryOutcome::Confirmed),
            Err(error) if matches!(error.problem_status(), Some(409)) => {
                tracing::warn!(job = %self.job_id, attempt = self.attempt, %error, "the server refused a stale delivery");
                Ok(DeliveryOutcome::Stale)
            }
            Err(error) => Err(error),
        }
    }

    /// The failure to report in place of a delivery whose content the server refuses. None when the refusal is not about the content, or the
    /// delivery has no result to leave out.
    pub fn as_failure(self, refusal: &ClientError) -> Option<Self> {
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

/// The folder of deliveries to one server.
#[derive(Clone, Debug)]
pub struct Outbox {
    folder: PathBuf,
}

impl Outbox {
    /// Opens or creates the outbox of one server in a worker's state directory. The key names the server, such as its address.
    pub fn open(state_dir: &Path, key: &str) -> io::Result<Self> {
        let folder = state_dir.join("outbox").join(folder_name(key));
        fs::create_dir_all(folder.join("refused"))?;
        remove_abandoned(&folder)?;
        remove_abandoned_frames(&folder)?;
        Ok(Self { folder })
    }

    /// Writes a delivery that survives a crash, and returns its path.
    pub fn put(&self, delivery: &Delivery) -> io::Result<PathBuf> {
        let path = self.folder.join(format!("{}-{}.json", delivery.job_id, delivery.attempt));
        let temporary = self.folder.join(format!("{}.tmp", Uuid::now_v7()));
        let mut file = File::create_new(&temporary)?;
        file.write_all(&serde_json::to_vec(delivery)?)?;
        file.sync_all()?;
        fs::rename(&temporary, &path)?;
        self.sync_folder()?;
        Ok(path)
    }

    /// The folder for the frames of an attempt; it may exist before the delivery does.
    pub fn frames_folder(&self, job_id: JobId, attempt: u32) -> PathBuf {
        self.folder.join(format!("{job_id}-{attempt}.{FRAMES_EXTENSION}"))
    }

    /// Paths of the waiting deliveries, oldest job first.
    pub fn waiting(&self) -> io::Result<Vec<PathBuf>> {
        let mut paths: Vec<_> = fs::read_dir(&self.folder)?
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<io::Result<_>>()?;
        paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
        paths.sort();
        Ok(paths)
    }

    /// Reads a delivery; none when another worker has delivered it meanwhile. Moves an unreadable file to `refused/`.
    pub fn read(&self, path: &Path) -> io::Result<Option<Delivery>> {
        let bytes = match fs::read(path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error),
        };
        match serde_json::from_slice(&bytes) {
            Ok(delivery) => Ok(Some(delivery)),
            Err(error) => {
                tracing::error!(path = %path.display(), %error, "moved an unreadable delivery to `refused`");
                self.set_aside(path)?;
                Ok(None)
            }
        }
    }

    /// Removes a delivery with its frames.
    pub fn remove(&self, path: &Path) -> io::Result<()> {
        ignore_missing(fs::remove_file(path))?;
        ignore_missing(fs::remove_dir_all(path.with_extension(FRAMES_EXTENSION)))?;
        self.sync_folder()
    }

    /// Moves a delivery to `refused/`, without its frames.
    pub fn set_aside(&self, path: &Path) -> io::Result<()> {
        let name = path.file_name().unwrap_or_default();
        ignore_missing(fs::rename(path, self.folder.join("refused").join(name)))?;
        ignore_missing(fs::remove_dir_all(path.with_extension(FRAMES_EXTENSION)))?;
        self.sync_folder()
    }

    /// Copies a refused delivery to `refused/`, and puts a report about it in its place, without frames. After a failure, such as a full disk,
    /// the delivery still waits.
    pub fn replace_refused(&self, path: &Path, report: &Delivery) -> io::Result<PathBuf> {
        let name = path.file_name().unwrap_or_default();
        fs::copy(path, self.folder.join("refused").join(name))?;
        let replaced = self.put(report)?;
        ignore_missing(fs::remove_dir_all(path.with_extension(FRAMES_EXTENSION)))?;
        Ok(replaced)
    }

    fn sync_folder(&self) -> io::Result<()> {
        File::open(&self.folder)?.sync_all()
    }
}

/// The folder name of a server's address, unique to it.
fn folder_name(key: &str) -> String {
    let address = key.strip_prefix("http://").unwrap_or(key).trim_end_matches('/');
    let mut name = String::with_capacity(address.len());
    for byte in address.bytes() {
        match byte {
            b'.' if name.is_empty() => name.push_str("%2e"), // avoids hidden folders and `..`
            b'.' | b'-' | b'0'..=b'9' | b'a'..=b'z' => name.push(byte.into()),
            b'A'..=b'Z' => name.push(byte.to_ascii_lowercase().into()),
            b':' => name.push('_'),
            other => name.push_str(&format!("%{other:02x}")),
        }
    }
    name
}

fn ignore_missing(outcome: io::Result<()>) -> io::Result<()> {
    match outcome {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        outcome => outcome,
    }
}

/// Removes frames without a delivery that no run is still recording.
fn remove_abandoned_frames(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let is_frames = path.extension().is_some_and(|extension| extension == FRAMES_EXTENSION);
        if !is_frames || path.with_extension("json").exists() {
            continue;
        }
        let changed = |path: &Path| fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
        let newest = changed(&path.join(roost_frames::STREAM)).or_else(|| changed(&path));
        let age = newest.map(|then| SystemTime::now().duration_since(then).unwrap_or_default());
        if age.is_some_and(|age| age > ABANDONED_AFTER) {
            ignore_missing(fs::remove_dir_all(path))?;
        }
    }
    Ok(())
}

/// Removes temporary files that no worker is still writing.
pub(crate) fn remove_abandoned(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let is_half_written = entry.path().extension().is_some_and(|extension| extension == "tmp");
        let Ok(modified) = entry.metadata().and_then(|metadata| metadata.modified()) else { continue };
        let age = SystemTime::now().duration_since(modified).unwrap_or_default();
        if is_half_written && age > ABANDONED_AFTER {
            ignore_missing(fs::remove_file(entry.path()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
