//! The mesh cache: number of fetches, and handling of damaged files.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::client::tests::answering_by;

/// One triangle, in small letters: the test server lowers its requests.
const FILE: &str = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 10 0 0\nvertex 0 10 0\nendloop\nendfacet\nendsolid s\n";

/// A cache whose server gives these answers in turn and repeats the last one, and the number of its requests.
async fn cache(
    folder: &Path,
    answers: &'static [(&'static str, &'static str)],
) -> (Arc<MeshCache>, Arc<AtomicUsize>) {
    let requests = Arc::new(AtomicUsize::new(0));
    let count = requests.clone();
    let server = answering_by("model/stl", move |request| {
        assert!(request.starts_with("get /v1/meshes/") && request.contains("/file http"), "{request}");
        let (status, body) = answers[count.fetch_add(1, Ordering::SeqCst).min(answers.len() - 1)];
        (status.to_owned(), body.to_owned())
    })
    .await;
    (Arc::new(MeshCache::open(folder, Client::new(&server).unwrap()).unwrap()), requests)
}

fn digests() -> Vec<String> {
    vec![digest(FILE.as_bytes())]
}

#[tokio::test]
async fn jobs_fetch_a_file_once_and_another_worker_uses_it() {
    let folder = tempfile::tempdir().unwrap();
    let (first, requests) = cache(folder.path(), &[("200 OK", FILE)]).await;
    let jobs: Vec<_> = (0..8)
        .map(|_| {
            let first = first.clone();
            tokio::spawn(async move { first.load(digests()).await })
        })
        .collect();
    for job in jobs {
        let meshes = job.await.unwrap().unwrap();
        assert!(meshes.get(&digests()[0]).is_some());
    }
    assert_eq!(requests.load(Ordering::SeqCst), 1);
    let (second, requests) = cache(folder.path(), &[("200 OK", FILE)]).await;
    second.load(digests()).await.unwrap();
    assert_eq!(requests.load(Ordering::SeqCst), 0);
    let files: Vec<_> = fs::read_dir(folder.path().join("meshes")).unwrap().collect();
    assert_eq!(files.len(), 1, "nothing half-written is left: {files:?}");
}

#[tokio::test]
async fn a_damaged_file_is_fetched_again_and_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, requests) = cache(folder.path(), &[("200 OK", FILE)]).await;
    let path = cache.path(&digests()[0]);
    for damaged in [&FILE[..40], ""] {
        fs::write(&path, damaged).unwrap();
        cache.load(digests()).await.unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), FILE);
    }
    assert_eq!(requests.load(Ordering::SeqCst), 2);
}

#[tokio::test]
async fn jobs_run_when_the_cache_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, requests) = cache(folder.path(), &[("200 OK", FILE)]).await;
    // A folder in place of the file.
    fs::create_dir(cache.path(&digests()[0])).unwrap();
    for _ in 0..2 {
        cache.load(digests()).await.unwrap();
    }
    assert_eq!(requests.load(Ordering::SeqCst), 2);
}

#[tokio::test]
async fn temporary_failures_are_retried_and_final_ones_reported() {
    const BUSY: (&str, &str) = ("503 Service Unavailable", "busy");
    let folder = tempfile::tempdir().unwrap();
    let (patient, requests) =
        cache(folder.path(), &[BUSY, ("200 OK", "solid other"), ("200 OK", FILE)]).await;
    patient.load(digests()).await.unwrap();
    assert_eq!(requests.load(Ordering::SeqCst), 3);

    const GONE: &str =
        r#"{"type": "/problems/not-found", "title": "none", "status": 404, "detail": "there is no mesh"}"#;
    let folder = tempfile::tempdir().unwrap();
    let (hopeless, requests) = cache(folder.path(), &[("404 Not Found", GONE)]).await;
    let failure = hopeless.load(digests()).await.unwrap_err();
    assert_eq!(failure.to_string(), format!("cannot fetch mesh {}: there is no mesh", digests()[0]));
    assert_eq!(requests.load(Ordering::SeqCst), 1);
}

#[tokio::test]
async fn a_file_that_is_not_a_mesh_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, _) = cache(folder.path(), &[("200 OK", "chicken")]).await;
    let failure = cache.load(vec![digest(b"chicken")]).await.unwrap_err();
    assert!(matches!(failure, MeshFailure::Invalid { .. }), "{failure}");
    assert!(failure.to_string().contains("STL"), "{failure}");
}
