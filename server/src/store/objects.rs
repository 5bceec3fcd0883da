//! Large objects: files beside the database or in a bucket, named by the blake3 of their bytes.
//!
//! A file is complete and on disk before a row names it. It is removed when no row names it any more: at once after a deletion, or by a
//! daily sweep. A lock keeps removals out of the time between the name of a file and its row.

use std::fs;
use std::io;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use futures_util::stream::BoxStream;
use futures_util::{Stream, StreamExt, TryStreamExt, stream};
use object_store::local::LocalFileSystem;
use object_store::path::Path as ObjectPath;
use object_store::{GetOptions, ObjectStore, ObjectStoreExt, WriteMultipart};
use tokio::sync::{RwLock, RwLockReadGuard, RwLockWriteGuard};
use uuid::Uuid;

use super::{Bucket, StoreError};

/// Folder of incomplete uploads.
const UPLOADS: &str = "uploads";

/// Bytes of one write to a folder.
const PART_BYTES: usize = 1024 * 1024;

/// The same for a bucket, which takes no less than 5 MiB and no more than 10,000 parts.
const BUCKET_PART_BYTES: usize = 8 * 1024 * 1024;

/// First bytes of an upload, which identify its format.
const HEAD_BYTES: usize = 8;

/// The folder of objects, or their bucket.
#[derive(Debug)]
pub(super) struct Objects {
    files: Arc<dyn ObjectStore>,
    part_bytes: usize,
    removals: RwLock<()>,
}

/// A complete upload without a name.
#[derive(Debug)]
pub(crate) struct Staged {
    place: ObjectPath,
    /// blake3 of its bytes.
    pub(crate) digest: String,
    /// Its length.
    pub(crate) bytes: u64,
    /// Its first bytes.
    pub(crate) head: Vec<u8>,
}

/// The reason why an upload was not stored.
#[derive(Debug)]
pub(crate) enum StageError<E> {
    /// It was interrupted.
    Broken(E),
    /// It is over the limit.
    TooLong,
    /// It could not be written.
    Store(StoreError),
}

/// The bytes of an object, as they are read.
pub(crate) type Reading = BoxStream<'static, Result<Bytes, StoreError>>;

impl Objects {
    /// Opens the bucket, or else the folder.
    pub(super) async fn open(folder: &Path, bucket: Option<&Bucket>) -> Result<Self, StoreError> {
        match bucket {
            Some(bucket) => Self::in_bucket(bucket).await,
            None => Self::in_folder(folder),
        }
    }

    fn in_folder(folder: &Path) -> Result<Self, StoreError> {
        fs::create_dir_all(folder)?;
        let files = Arc::new(LocalFileSystem::new_with_prefix(folder)?.with_fsync(true));
        Ok(Self { files, part_bytes: PART_BYTES, removals: RwLock::default() })
    }

    /// Fails here if the bucket cannot be reached or written, and not at the first upload.
    async fn in_bucket(bucket: &Bucket) -> Result<Self, StoreError> {
        let files = bucket.open()?;
        let trial = ObjectPath::from(format!("{UPLOADS}/{}", Uuid::now_v7()));
        files.put(&trial, Bytes::new().into()).await.map_err(|source| bucket.unusable(source))?;
        files.delete(&trial).await.map_err(|source| bucket.unusable(source))?;
        Ok(Self { files, part_bytes: BUCKET_PART_BYTES, removals: RwLock::default() })
    }

    /// Removes uploads that an earlier server did not finish. Only the server that leads may do so.
    pub(super) async fn remove_unfinished(&self) -> Result<(), StoreError> {
        let unfinished: Vec<_> = self.files.list(Some(&ObjectPath::from(UPLOADS))).try_collect().await?;
        for upload in unfinished {
            match self.files.delete(&upload.location).await {
                // The last leader may still discard its own.
                Ok(()) | Err(object_store::Error::NotFound { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// Stores bytes as they arrive, up to a limit.
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
            // One part is written while the next arrives: memory holds two parts.
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
            Err(reason) => {
                let _ = writing.abort().await;
                Err(reason)
            }
        }
    }

    /// Joins uploads to one, and removes them.
    pub(super) async fn join(&self, parts: Vec<Staged>) -> Result<Staged, StoreError> {
        let places: Vec<_> = parts.iter().map(|part| part.place.clone()).collect();
        let files = self.files.clone();
        let read = move |place: ObjectPath| {
            let files = files.clone();
            async move { Ok::<_, object_store::Error>(files.get(&place).await?.into_stream()) }
        };
        let bytes: BoxStream<'static, Result<Bytes, object_store::Error>> =
            stream::iter(places).then(read).try_flatten().boxed();
        let joined = self.stage(bytes, u64::MAX).await;
        for part in parts {
            self.discard(part).await;
        }
        joined.map_err(|error| match error {
            StageError::Broken(error) => error.into(),
            StageError::Store(error) => error,
            StageError::TooLong => unreachable!("no limit"),
        })
    }

    /// Gives an upload its name. No object is removed while the guard lives: the caller inserts the row meanwhile.
    pub(super) async fn publish(&self, staged: Staged) -> Result<RwLockReadGuard<'_, ()>, StoreError> {
        let guard = self.removals.read().await;
        self.files.rename(&staged.place, &path_of(&staged.digest)).await?;
        Ok(guard)
    }

    /// Removes an upload.
    pub(super) async fn discard(&self, staged: Staged) {
        if let Err(error) = self.files.delete(&staged.place).await {
            tracing::warn!(%error, "an unused upload was not removed; the next start removes it");
        }
    }

    /// Reads a part of an object; none when it does not exist.
    pub(super) async fn read(&self, digest: &str, part: Range<u64>) -> Result<Option<Reading>, StoreError> {
        let options = GetOptions { range: Some(part.into()), ..GetOptions::default() };
        match self.files.get_opts(&path_of(digest), options).await {
            Ok(found) => Ok(Some(found.into_stream().map_err(StoreError::from).boxed())),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// No upload gets a name while the guard lives: the caller checks whether a row names an object, and removes it.
    pub(super) async fn lock_removal(&self) -> RwLockWriteGuard<'_, ()> {
        self.removals.write().await
    }

    /// Removes an object; false when it does not exist.
    pub(super) async fn remove(&self, digest: &str) -> Result<bool, StoreError> {
        match self.files.delete(&path_of(digest)).await {
            Ok(()) => Ok(true),
            Err(object_store::Error::NotFound { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// The objects older than a time in milliseconds of the epoch.
    pub(super) async fn older_than(&self, before_ms: i64) -> Result<Vec<String>, StoreError> {
        let old = self.files.list(None).try_filter_map(|file| async move {
            let is_old = file.last_modified.timestamp_millis() < before_ms;
            let name = file.location.filename().map(str::to_owned);
            Ok(name.filter(|name| is_old && file.location == path_of(name)))
        });
        Ok(old.try_collect().await?)
    }
}

/// The path of an object. Subfolders keep the number of files per folder small.
fn path_of(digest: &str) -> ObjectPath {
    ObjectPath::from(format!("{}/{digest}", digest.get(..2).unwrap_or_default()))
}

/// Copies objects from one folder to another. Returns the bytes copied, and the number of missing objects.
pub(super) fn copy(from: &Path, to: &Path, named: &[String]) -> io::Result<(u64, u64)> {
    let (mut bytes, mut missing) = (0, 0);
    for digest in named {
        let place = path_of(digest).to_string();
        let (source, target) = (from.join(&place), to.join(&place));
        if target.exists() {
            continue;
        }
        if !source.exists() {
            missing += 1;
            continue;
        }
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder)?;
        }
        // Under another name until it is complete, so that readers find all of it or nothing.
        let partial = target.with_extension("part");
        bytes += fs::copy(source, &partial)?;
        fs::File::open(&partial)?.sync_all()?;
        fs::rename(partial, target)?;
    }
    Ok((bytes, missing))
}

#[cfg(test)]
mod tests;
