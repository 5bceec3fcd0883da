//! Parts of checkpoints or fills whose upload is not complete, at most one upload for each job.
//!
//! They are in memory and in the folder of unnamed uploads. A restart of the server removes both, and the upload begins again.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use roost_api::ids::JobId;

use crate::store::Staged;

/// An upload: its job and attempt, and the digest of the whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct UploadKey {
    pub(crate) job: JobId,
    pub(crate) attempt: u32,
    pub(crate) digest: String,
}

/// The incomplete uploads of all jobs.
#[derive(Default)]
pub(crate) struct PartialUploads(Mutex<HashMap<JobId, Incomplete>>);

struct Incomplete {
    key: UploadKey,
    parts: Vec<Staged>,
}

impl Incomplete {
    fn bytes(&self) -> u64 {
        self.parts.iter().map(|part| part.bytes).sum()
    }
}

/// The effect of a new part.
#[derive(Debug)]
pub(crate) struct Added {
    /// Bytes of the upload that have arrived.
    pub(crate) received: u64,
    /// All parts, once the upload is complete. It is then forgotten here.
    pub(crate) complete: Option<Vec<Staged>>,
    /// Parts that no upload uses, for the caller to discard.
    pub(crate) unused: Vec<Staged>,
}

impl PartialUploads {
    fn lock(&self) -> MutexGuard<'_, HashMap<JobId, Incomplete>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Bytes of an upload that have arrived.
    pub(crate) fn received(&self, key: &UploadKey) -> u64 {
        self.lock().get(&key.job).filter(|upload| upload.key == *key).map_or(0, Incomplete::bytes)
    }

    /// Adds a part at an offset of an upload of `total` bytes. It replaces another upload of the job. A part that does not begin where the
    /// upload ends is not added.
    pub(crate) fn add(&self, key: &UploadKey, offset: u64, part: Staged, total: u64) -> Added {
        let mut uploads = self.lock();
        let known = uploads.get(&key.job).filter(|upload| upload.key == *key).map(Incomplete::bytes);
        if known.unwrap_or(0) != offset || part.bytes == 0 {
            return Added { received: known.unwrap_or(0), complete: None, unused: vec![part] };
        }
        let before = uploads.remove(&key.job).map_or_else(Vec::new, |upload| upload.parts);
        let (mut parts, unused) = if known.is_some() { (before, Vec::new()) } else { (Vec::new(), before) };
        parts.push(part);
        let upload = Incomplete { key: key.clone(), parts };
        let received = upload.bytes();
        if received == total {
            return Added { received, complete: Some(upload.parts), unused };
        }
        uploads.insert(key.job, upload);
        Added { received, complete: None, unused }
    }

    /// Jobs with an incomplete upload.
    pub(crate) fn jobs(&self) -> Vec<JobId> {
        self.lock().keys().copied().collect()
    }

    /// Takes the parts of jobs that no longer run.
    pub(crate) fn take(&self, ended: impl Iterator<Item = JobId>) -> Vec<Staged> {
        let mut uploads = self.lock();
        ended.filter_map(|job| uploads.remove(&job)).flat_map(|upload| upload.parts).collect()
    }
}
