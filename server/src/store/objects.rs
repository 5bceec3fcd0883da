//! Large things as files of their own beside the database, or in a bucket, named by the blake3 of their bytes.
//!
//! A file is whole and on disk before a row names it. It goes when no row names it any more: at once where that is known, else when it
//! is found a day later. The gate keeps the two apart: nothing is removed between the moment a file gets its name and that of its row.

use std::fs;
use std::io;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use futures_util::stream::BoxStream;
use futures_util::{Stream, StreamExt, TryStreamExt};
use object_store::local::LocalFileSystem;
use object_store::path::Path as ObjectPath;
use object_store::{GetOptions, ObjectStore, ObjectStoreExt, WriteMultipart};
use tokio::sync::{RwLock, RwLockReadGuard, RwLockWriteGuard};
use uuid::Uuid;

use super::{Bucket, StoreError};

/// Where uploads lie until they are whole.
const UPLOADS: &str = "uploads";

/// Bytes that are written to a folder at a time.
const PART_BYTES: usize = 1024 * 1024;

/// The same for a bucket, which takes no less than 5 MiB and no more than 10,000 parts.
const BUCKET_PART_BYTES: usize = 8 * 1024 * 1024;

/// Of every upload its first bytes, which say what it is.
const HEAD_BYTES: usize = 8;

/// The folder of objects, or their bucket.
#[derive(Debug)]
pub(super) struct Objects {
    files: Arc<dyn ObjectStore>,
    part_bytes: usize,
    gate: RwLock<()>,
}

/// An upload that is whole but has no name yet.
#[derive(Debug)]
pub(crate) struct Staged {
    place: ObjectPath,
    /// blake3 of its bytes.
    pub(crate) digest: String,
    /// How many they are.
    pub(crate) bytes: u64,
    /// The first of them.
    pub(crate) head: Vec<u8>,
}

/// Why an upload was not taken in.
#[derive(Debug)]
pub(crate) enum StageError<E> {
    /// It broke off.
    Broken(E),
    /// It is over the limit.
    TooLong,
    /// It could not be written.
    Store(StoreError),
}

/// The bytes of an object, as they are read.
pub(crate) type Reading = BoxStream<'static, Result<Bytes, StoreError>>;

impl Objects {
    /// Opens the bucket, or else the folder, made as needed. What uploads left in it that broke off with the last server is removed.
    pub(super) async fn open(folder: &Path, bucket: Option<&Bucket>) -> Result<Self, StoreError> {
        match bucket {
            Some(bucket) => Self::in_bucket(bucket).await,
            None => Self::in_folder(folder),
        }
    }

    fn in_folder(folder: &Path) -> Result<Self, StoreError> {
        fs::create_dir_all(folder)?;
        match fs::remove_dir_all(folder.join(UPLOADS)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error.into()),
            _ => {}
        }
        let files = Arc::new(LocalFileSystem::new_with_prefix(folder)?.with_fsync(true));
        Ok(Self { files, part_bytes: PART_BYTES, gate: RwLock::default() })
    }

    /// A bucket that cannot be reached is found here, and not by the first upload.
    async fn in_bucket(bucket: &Bucket) -> Result<Self, StoreError> {
        let files = bucket.open()?;
        let broken: Vec<_> = files
            .list(Some(&ObjectPath::from(UPLOADS)))
            .try_collect()
            .await
            .map_err(|source| bucket.unusable(source))?;
        for upload in broken {
            files.delete(&upload.location).await?;
        }
        Ok(Self { files, part_bytes: BUCKET_PART_BYTES, gate: RwLock::default() })
    }

    /// Takes bytes in as they arrive, up to a limit.
    pub(super) async fn stage<E>(
        &self,
        mut bytes: impl Stream<Item = Result<Bytes, E>> + Unpin,
        limit: u64,
    ) -> Result<Staged, StageError<E>> {
        let store = |error: object_store::Error| StageError::Store(error.into());
        let place = ObjectPath::from(format!("{UPLOADS}/{}", Uuid::now_v7()));
        let upload = self.files.put_multipart(&place).await.map_err(store)?;
        let mut writing = WriteMultipart::new_with_chunk_size(upload, self.part_bytes);
        let (mut hash, mut length, mut head) = (blake3::Hasher::new(), 0, Vec::new());
        let ended = loop {
            let chunk = match bytes.next().await {
                None => break Ok(()),
                Some(Err(error)) => break Err(StageError::Broken(error)),
                Some(Ok(chunk)) => chunk,
            };
            length += chunk.len() as u64;
            if length > limit {
                break Err(StageError::TooLong);
            }
            hash.update(&chunk);
            head.extend(chunk.iter().take(HEAD_BYTES - head.len()));
            // One part is written while the next arrives: that is all that is in memory.
            if let Err(error) = writing.wait_for_capacity(1).await {
                break Err(store(error));
            }
            writing.put(chunk);
        };
        match ended {
            Ok(()) => {
                writing.finish().await.map_err(store)?;
                Ok(Staged { place, digest: hash.finalize().to_hex().to_string(), bytes: length, head })
            }
            Err(why) => {
                let _ = writing.abort().await;
                Err(why)
            }
        }
    }

    /// Gives an upload its name. No object is removed while the guard lives, in which time a row must name it.
    pub(super) async fn publish(&self, staged: Staged) -> Result<RwLockReadGuard<'_, ()>, StoreError> {
        let open = self.gate.read().await;
        self.files.rename(&staged.place, &path_of(&staged.digest)).await?;
        Ok(open)
    }

    /// Forgets an upload.
    pub(super) async fn discard(&self, staged: Staged) {
        if let Err(error) = self.files.delete(&staged.place).await {
            tracing::warn!(%error, "an upload that nobody wants stays until the next start");
        }
    }

    /// Reads a part of an object; none when it is not there.
    pub(super) async fn read(&self, digest: &str, part: Range<u64>) -> Result<Option<Reading>, StoreError> {
        let options = GetOptions { range: Some(part.into()), ..GetOptions::default() };
        match self.files.get_opts(&path_of(digest), options).await {
            Ok(found) => Ok(Some(found.into_stream().map_err(StoreError::from).boxed())),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Nothing gets a name while the guard lives, in which time it can be asked whether an object has one.
    pub(super) async fn lock_removal(&self) -> RwLockWriteGuard<'_, ()> {
        self.gate.write().await
    }

    /// Removes an object; false when it is not there.
    pub(super) async fn remove(&self, digest: &str) -> Result<bool, StoreError> {
        match self.files.delete(&path_of(digest)).await {
            Ok(()) => Ok(true),
            Err(object_store::Error::NotFound { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// The objects that have lain there since before then, in milliseconds of the epoch.
    pub(super) async fn older_than(&self, then_ms: i64) -> Result<Vec<String>, StoreError> {
        let old = self.files.list(None).try_filter_map(|file| async move {
            let is_old = file.last_modified.timestamp_millis() < then_ms;
            let name = file.location.filename().map(str::to_owned);
            Ok(name.filter(|name| is_old && file.location == path_of(name)))
        });
        Ok(old.try_collect().await?)
    }
}

/// Where an object lies: thousands in one folder are slow to look through.
fn path_of(digest: &str) -> ObjectPath {
    ObjectPath::from(format!("{}/{digest}", digest.get(..2).unwrap_or_default()))
}

/// Copies those objects of a folder that are named to another folder; what is not there is passed over. Returns the bytes that were
/// copied, and how many objects were not there.
pub(super) fn copy(from: &Path, to: &Path, named: &[String]) -> io::Result<(u64, u64)> {
    let (mut bytes, mut absent) = (0, 0);
    for digest in named {
        let place = path_of(digest).to_string();
        let (source, target) = (from.join(&place), to.join(&place));
        if target.exists() {
            continue;
        }
        if !source.exists() {
            absent += 1;
            continue;
        }
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder)?;
        }
        // Under another name until it is whole: who looks for the object finds all of it or nothing.
        let beside = target.with_extension("part");
        bytes += fs::copy(source, &beside)?;
        fs::File::open(&beside)?.sync_all()?;
        fs::rename(beside, target)?;
    }
    Ok((bytes, absent))
}

#[cfg(test)]
mod tests;
