//! Databases for tests: each test runs on SQLite and on PostgreSQL.

mod cluster;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU32, Ordering};

pub(super) use cluster::Cluster;

use super::{Location, OBJECTS, Store};

/// The PostgreSQL of this process. It flushes nothing to disk: the store is under test, not the disk.
static CLUSTER: LazyLock<Cluster> = LazyLock::new(|| {
    let memory = Path::new("/dev/shm");
    let below = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
    Cluster::start(&below, "-c fsync=off -c synchronous_commit=off -c full_page_writes=off")
});

/// Databases of this process so far.
static DATABASES: AtomicU32 = AtomicU32::new(0);

/// A new database and a folder.
pub(super) struct Place {
    pub(super) location: Location,
    /// The address of a database of PostgreSQL.
    address: String,
    folder: tempfile::TempDir,
}

impl Place {
    /// A file, in memory where possible.
    pub(super) fn sqlite() -> Self {
        let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
        Self { location: Location::File(folder.path().join("roost.db")), address: String::new(), folder }
    }

    /// A database of PostgreSQL.
    pub(super) fn postgres() -> Self {
        let address = CLUSTER.create(&format!("test_{}", DATABASES.fetch_add(1, Ordering::Relaxed)));
        Self { location: address.parse().unwrap(), address, folder: tempfile::tempdir().unwrap() }
    }

    /// The address of a database of PostgreSQL.
    pub(super) fn address(&self) -> &str {
        &self.address
    }

    /// The folder of objects.
    pub(super) fn objects(&self) -> PathBuf {
        self.folder.path().join(OBJECTS)
    }

    /// The store at this place.
    pub(super) async fn open(&self) -> Store {
        Store::open(&self.location, &self.objects(), None).await.unwrap()
    }
}

/// Number of rows that refer to a missing one. PostgreSQL itself does not check the references that claims and results write.
pub(super) const DANGLING: &str = "SELECT
    (SELECT count(*) FROM attempts a WHERE NOT EXISTS (SELECT 1 FROM jobs WHERE id = a.job_id)
        OR NOT EXISTS (SELECT 1 FROM workers WHERE id = a.worker_id))
    + (SELECT count(*) FROM jobs j WHERE worker_id IS NOT NULL AND NOT EXISTS (SELECT 1 FROM workers WHERE id = j.worker_id))
    + (SELECT count(*) FROM results r WHERE NOT EXISTS (SELECT 1 FROM jobs WHERE id = r.job_id)
        OR NOT EXISTS (SELECT 1 FROM documents WHERE digest = r.document_digest))";

/// Makes two tests of each function: `name::sqlite` and `name::postgres`.
macro_rules! on_both_engines {
    ($($name:ident),+ $(,)?) => {
        $(mod $name {
            use crate::store::testing::Place;

            #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn sqlite() {
                super::$name(Place::sqlite()).await;
            }

            #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn postgres() {
                super::$name(Place::postgres()).await;
            }
        })+
    };
}

pub(super) use on_both_engines;
