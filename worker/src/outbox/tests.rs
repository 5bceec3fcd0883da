//! The outbox: stored, removed and refused deliveries.

use roost_api::ids::WorkerId;

use super::*;
use crate::client::tests::answering;

const SERVER: &str = "http://127.0.0.1:7373";

fn delivery(attempt: u32) -> Delivery {
    let report = FailureReport {
        worker_id: WorkerId::new(),
        outcome: AttemptOutcome::Worker,
        message: "tried".to_owned(),
        result: None,
    };
    Delivery { job_id: JobId::new(), attempt, content: Content::Failure(report), frames: None }
}

fn outbox() -> (tempfile::TempDir, Outbox) {
    let folder = tempfile::tempdir().unwrap();
    let outbox = Outbox::open(folder.path(), SERVER).unwrap();
    (folder, outbox)
}

#[test]
fn a_delivery_survives_a_restart_until_it_is_removed() {
    let (folder, outbox) = outbox();
    let first = delivery(1);
    let path = outbox.put(&first).unwrap();
    outbox.put(&delivery(7)).unwrap();
    drop(outbox);

    let outbox = Outbox::open(folder.path(), SERVER).unwrap();
    let waiting = outbox.waiting().unwrap();
    let found: Vec<_> = waiting.iter().map(|path| outbox.read(path).unwrap().unwrap()).collect();
    assert_eq!(found.iter().map(|delivery| delivery.attempt).collect::<Vec<_>>(), [1, 7]);
    assert_eq!(found[0].job_id, first.job_id);
    outbox.remove(&path).unwrap();
    outbox.remove(&path).expect("another worker may have removed it");
    assert_eq!(outbox.waiting().unwrap().len(), 1);
}

#[test]
fn an_attempt_has_one_delivery() {
    let (_folder, outbox) = outbox();
    let same = delivery(1);
    outbox.put(&same).unwrap();
    outbox.put(&same).unwrap();
    assert_eq!(outbox.waiting().unwrap().len(), 1);
}

#[test]
fn servers_do_not_share_their_deliveries() {
    let folder = tempfile::tempdir().unwrap();
    let addresses =
        [SERVER, "http://127.0.0.1:7374", "http://[::1]:7373", "http://a:1/b", "http://a:1_b", "../up", ".."];
    for address in addresses {
        let outbox = Outbox::open(folder.path(), address).unwrap();
        assert!(outbox.waiting().unwrap().is_empty(), "{address} shows deliveries to another server");
        let path = outbox.put(&delivery(1)).unwrap();
        assert!(path.starts_with(folder.path().join("outbox")) && !path.to_string_lossy().contains("/.."));
    }
    let again = Outbox::open(folder.path(), "http://127.0.0.1:7373/").unwrap();
    assert_eq!(again.waiting().unwrap().len(), 1);
}

#[test]
fn incomplete_and_unreadable_files_are_skipped() {
    let (folder, outbox) = outbox();
    outbox.put(&delivery(3)).unwrap();
    let inside = folder.path().join("outbox/127.0.0.1_7373");
    fs::write(inside.join("killed-here.tmp"), "{\"job_id\":").unwrap();
    fs::write(inside.join("broken-1.json"), "{\"job_id\":").unwrap();
    assert!(outbox.read(&inside.join("broken-1.json")).unwrap().is_none());
    assert!(inside.join("refused/broken-1.json").exists());
    assert!(outbox.read(&inside.join("delivered-by-another-worker-1.json")).unwrap().is_none());
    assert_eq!(outbox.waiting().unwrap().len(), 1);

    let old = File::options().write(true).open(inside.join("killed-here.tmp")).unwrap();
    old.set_modified(SystemTime::now() - 2 * ABANDONED_AFTER).unwrap();
    fs::write(inside.join("being-written-now.tmp"), "{").unwrap();
    Outbox::open(folder.path(), SERVER).unwrap();
    assert!(!inside.join("killed-here.tmp").exists());
    assert!(inside.join("being-written-now.tmp").exists());
}

#[tokio::test]
async fn only_2xx_and_409_of_the_server_settle_a_delivery() {
    let problem =
        |status: u16| format!(r#"{{"type":"/problems/x","title":"x","status":{status},"detail":"because"}}"#);
    let cases = [
        ("200 OK", "{}".to_owned(), Some(DeliveryOutcome::Confirmed)),
        ("409 Conflict", problem(409), Some(DeliveryOutcome::Stale)),
        ("422 Unprocessable Entity", problem(422), None),
        ("500 Internal Server Error", problem(500), None),
        ("404 Not Found", problem(404), None),
        ("409 Conflict", "an answer of a proxy".to_owned(), None),
    ];
    for (status, body, expected) in cases {
        let server = answering(status, "application/problem+json", &body).await;
        let outcome = delivery(1).send(&Client::new(&server).unwrap()).await;
        assert_eq!(outcome.ok(), expected, "{status} {body}");
    }
}
