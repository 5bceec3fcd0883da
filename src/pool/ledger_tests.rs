//! Tests of `ledger`: the memory of a pool on disk.

use super::*;

#[test]
fn a_ledger_is_stored_whole_and_read_again() {
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("pool");
    assert_eq!(read(&path).unwrap(), None);
    let folder = Folder::open(&path).unwrap();
    let mut ledger = Ledger::new("roost-pool-1".to_owned(), Timestamp(1000));
    ledger.allocations.push(Allocation::waiting(17, Timestamp(2000)));
    ledger.failures.add(Timestamp(3000), "refused".to_owned());
    folder.save(&ledger).unwrap();
    assert_eq!(read(&path).unwrap(), Some(ledger));
    assert!(is_in_use(&path));
    let error = Folder::open(&path).unwrap_err();
    assert!(error.to_string().contains("another pool runs on the folder"), "{error}");
    drop(folder);
    assert!(!is_in_use(&path));
    Folder::open(&path).unwrap();
}

#[test]
fn a_file_of_another_kind_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let ledger = Ledger { schema: "roost.pool/9".to_owned(), ..Ledger::new(String::new(), Timestamp(0)) };
    for text in ["{}".to_owned(), "no JSON".to_owned(), serde_json::to_string(&ledger).unwrap()] {
        std::fs::write(ledger_file(folder.path()), text).unwrap();
        let error = read(folder.path()).unwrap_err();
        assert!(error.to_string().contains("--state"), "{error}");
    }
}

#[test]
fn held_allocations_are_never_removed() {
    let mut ledger = Ledger::new(String::new(), Timestamp(0));
    for id in 0..500 {
        let state = if id % 2 == 0 { AllocationState::Completed } else { AllocationState::Running };
        ledger.allocations.push(Allocation { state, ..Allocation::waiting(id, Timestamp(0)) });
    }
    let removed = ledger.forget_old();
    assert_eq!((ledger.allocations.len(), ledger.held().count()), (450, 250));
    assert_eq!((removed.len(), removed[0], removed[49]), (50, 0, 98));
    assert_eq!(ledger.allocations[0].id, 1, "the oldest ended one is gone");
    assert_eq!(ledger.running(false), 250);
}

#[test]
fn a_moment_of_pool_list_keeps_no_pool_out() {
    let parent = tempfile::tempdir().unwrap();
    drop(Folder::open(parent.path()).unwrap());
    let list = File::open(lock_file(parent.path())).unwrap();
    list.lock_shared().unwrap();
    let release = std::thread::spawn(move || {
        sleep(Duration::from_millis(300));
        drop(list);
    });
    Folder::open(parent.path()).unwrap();
    release.join().unwrap();
}

#[test]
fn logs_are_read_at_their_end_and_removed_with_their_allocation() {
    let parent = tempfile::tempdir().unwrap();
    let folder = Folder::open(parent.path()).unwrap();
    let write = |id: &str, text: &[u8]| std::fs::write(log_file(folder.path(), id), text).unwrap();
    write("7", b"first\nlast \xff line\n\n");
    assert_eq!(folder.last_log_line(7).unwrap(), "last \u{fffd} line");
    write("8", &[&[b'x'; 100_000][..], b"\nlast\n"].concat());
    assert_eq!(folder.last_log_line(8).unwrap(), "last");
    assert_eq!(folder.last_log_line(9), None);
    folder.remove_logs(&[7, 9]);
    assert_eq!((folder.last_log_line(7), folder.last_log_line(8)), (None, Some("last".to_owned())));
}

#[test]
fn workers_that_a_view_lacks_count_as_coming() {
    let mut ledger = Ledger::new(String::new(), Timestamp(0));
    let workers = vec![Timestamp(10_000), Timestamp(20_000)];
    ledger.allocations.push(Allocation {
        state: AllocationState::Running,
        registered: true,
        working_since: Some(Timestamp(21_000)),
        workers,
        ..Allocation::waiting(7, Timestamp(0))
    });
    let unseen = |per_alloc, view, now| ledger.unseen_workers(per_alloc, Timestamp(view), Timestamp(now));
    assert_eq!(unseen(2, 9_000, 22_000), 2, "the view is older than both");
    assert_eq!(unseen(2, 15_000, 22_000), 1);
    assert_eq!(unseen(2, 20_500, 22_000), 1, "a registration may take a moment to show");
    assert_eq!(unseen(2, 21_000, 22_000), 0);
    assert_eq!(unseen(3, 21_000, 22_000), 1, "the third has not registered yet");
    assert_eq!(unseen(3, 21_000, 142_000), 0, "it never will");
    assert_eq!((ledger.unproven(), ledger.running(true)), (1, 1));
}
