//! What is fetched, how often, and what becomes of files that are not what they should be.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::client::tests::answering_by;

/// One triangle. The answering server knows small letters only.
const FILE: &str = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 10 0 0\nvertex 0 10 0\nendloop\nendfacet\nendsolid s\n";

/// A cache whose server gives these answers in turn, the last one for ever, and how often it was asked.
async fn cache(
    folder: &Path,
    answers: &'static [(&'static str, &'static str)],
) -> (Arc<MeshCache>, Arc<AtomicUsize>) {
    let asked = Arc::new(AtomicUsize::new(0));
    let count = asked.clone();
    let server = answering_by("model/stl", move |request| {
        assert!(request.starts_with("get /v1/meshes/") && request.contains("/file http"), "{request}");
        let (status, body) = answers[count.fetch_add(1, Ordering::SeqCst).min(answers.len() - 1)];
        (status.to_owned(), body.to_owned())
    })
    .await;
    (Arc::new(MeshCache::open(folder, Client::new(&server).unwrap()).unwrap()), asked)
}

fn wanted() -> Vec<String> {
    vec![digest(FILE.as_bytes())]
}

#[tokio::test]
async fn eight_jobs_fetch_a_file_once_and_the_next_worker_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let (first, asked) = cache(folder.path(), &[("200 OK", FILE)]).await;
    let jobs: Vec<_> = (0..8)
        .map(|_| {
            let first = first.clone();
            tokio::spawn(async move { first.load(wanted()).await })
        })
        .collect();
    for job in jobs {
        let meshes = job.await.unwrap().unwrap();
        assert!(meshes.get(&wanted()[0]).is_some());
    }
    assert_eq!(asked.load(Ordering::SeqCst), 1);
    let (second, asked) = cache(folder.path(), &[("200 OK", FILE)]).await;
    second.load(wanted()).await.unwrap();
    assert_eq!(asked.load(Ordering::SeqCst), 0);
    let files: Vec<_> = fs::read_dir(folder.path().join("meshes")).unwrap().collect();
    assert_eq!(files.len(), 1, "nothing half-written is left: {files:?}");
}

#[tokio::test]
async fn a_damaged_file_is_fetched_again_and_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, asked) = cache(folder.path(), &[("200 OK", FILE)]).await;
    let path = cache.path(&wanted()[0]);
    for damaged in [&FILE[..40], ""] {
        fs::write(&path, damaged).unwrap();
        cache.load(wanted()).await.unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), FILE);
    }
    assert_eq!(asked.load(Ordering::SeqCst), 2);
}

#[tokio::test]
async fn a_disk_that_keeps_nothing_stops_no_job() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, asked) = cache(folder.path(), &[("200 OK", FILE)]).await;
    // A folder stands where the file should.
    fs::create_dir(cache.path(&wanted()[0])).unwrap();
    for _ in 0..2 {
        cache.load(wanted()).await.unwrap();
    }
    assert_eq!(asked.load(Ordering::SeqCst), 2);
}

#[tokio::test]
async fn what_may_pass_is_tried_again_and_what_will_not_is_told() {
    const BUSY: (&str, &str) = ("503 Service Unavailable", "busy");
    let folder = tempfile::tempdir().unwrap();
    let (patient, asked) = cache(folder.path(), &[BUSY, ("200 OK", "solid other"), ("200 OK", FILE)]).await;
    patient.load(wanted()).await.unwrap();
    assert_eq!(asked.load(Ordering::SeqCst), 3);

    const GONE: &str =
        r#"{"type": "/problems/not-found", "title": "none", "status": 404, "detail": "there is no mesh"}"#;
    let folder = tempfile::tempdir().unwrap();
    let (hopeless, asked) = cache(folder.path(), &[("404 Not Found", GONE)]).await;
    let failure = hopeless.load(wanted()).await.unwrap_err();
    assert_eq!(failure.to_string(), format!("cannot fetch mesh {}: there is no mesh", wanted()[0]));
    assert_eq!(asked.load(Ordering::SeqCst), 1);
}

#[tokio::test]
async fn a_file_that_is_no_mesh_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let (cache, _) = cache(folder.path(), &[("200 OK", "chicken")]).await;
    let failure = cache.load(vec![digest(b"chicken")]).await.unwrap_err();
    assert!(matches!(failure, MeshFailure::Unsound { .. }), "{failure}");
    assert!(failure.to_string().contains("STL"), "{failure}");
}
