//! Displaced connections, and the counts of connections.

use super::*;

fn is_closing(slot: &ConnectionSlot) -> bool {
    use futures_util::FutureExt;
    slot.close.notify.notified().now_or_never().is_some()
}

fn count(connections: &Connections, reason: &Refused) -> u64 {
    connections.refused.get_or_create(reason).get()
}

/// An idle connection that has had a request.
fn idle_slot(connections: &Arc<Connections>) -> Arc<ConnectionSlot> {
    let slot = connections.enter().unwrap();
    drop(slot.begin("/v1/jobs").ok().unwrap());
    slot.note_written();
    slot
}

fn assert_is_empty(connections: &Connections) {
    let table = locked(&connections.table);
    assert_eq!(
        (table.open, table.answering, table.closing, table.without_request, table.waiting.len()),
        (0, 0, 0, 0, 0)
    );
}

#[test]
fn connections_without_request_are_displaced_before_idle_ones() {
    let connections = Arc::new(Connections::new(4));
    let (first, second) = (idle_slot(&connections), idle_slot(&connections));
    // Connected earlier, idle for a shorter time.
    drop(first.begin("/v1/jobs").ok().unwrap());
    first.note_written();
    let third = idle_slot(&connections);
    let without_request = connections.enter().unwrap();
    let fifth = idle_slot(&connections);
    assert!(is_closing(&without_request), "the newest, but without a request");
    let sixth = idle_slot(&connections);
    assert!(is_closing(&second) && !is_closing(&first) && !is_closing(&third), "idle longest");
    assert_eq!((count(&connections, &NO_REQUEST), count(&connections, &IDLE)), (1, 1));
    assert_eq!(connections.open(), 6, "two of them are closing");
    // A request may arrive while the connection is asked to close: it is answered.
    drop(second.begin("/v1/jobs").ok().unwrap());
    drop((first, second, third, without_request, fifth, sixth));
    assert_is_empty(&connections);
}

#[test]
fn connections_without_request_get_a_quarter_of_the_slots() {
    let connections = Arc::new(Connections::new(4000));
    let regular: Vec<_> = (0..4).map(|_| idle_slot(&connections)).collect();
    let without_request: Vec<_> = (0..1020).map(|_| connections.enter().unwrap()).collect();
    let closing = without_request.iter().take_while(|slot| is_closing(slot)).count();
    assert_eq!((closing, locked(&connections.table).without_request), (20, 1000), "the oldest are displaced");
    assert!(!regular.iter().any(|slot| is_closing(slot)));
    drop((regular, without_request));
    assert_is_empty(&connections);
}

#[test]
fn some_slots_are_reserved_for_idle_connections() {
    let connections = Arc::new(Connections::new(32));
    let slots: Vec<_> = (0..32).map(|_| idle_slot(&connections)).collect();
    let mut permits: Vec<_> = slots[..30].iter().map(|slot| slot.begin("/").ok().unwrap()).collect();
    assert_eq!(slots[30].begin("/").err().map(|refused| refused.limit), Some(30));
    permits.push(slots[31].begin("/metrics").ok().expect("always answered"));
    assert!(connections.enter().is_none(), "no connection waits");
    assert_eq!((count(&connections, &BUSY), count(&connections, &FULL)), (1, 1));
    permits.pop();
    let newest = connections.enter().expect("one connection waits now");
    assert!(is_closing(&slots[31]));
    drop((slots, permits, newest));
    assert_is_empty(&connections);
}

#[test]
fn unread_answers_are_displaced_last_and_few_connections_close_at_once() {
    let connections = Arc::new(Connections::new(32));
    let mut slots: Vec<_> = (0..32).map(|_| idle_slot(&connections)).collect();
    drop(slots[0].begin("/v1/jobs").ok().unwrap());
    for _ in 0..MIN_CLOSING {
        slots.push(idle_slot(&connections));
    }
    assert!(!is_closing(&slots[0]) && is_closing(&slots[1]) && is_closing(&slots[MIN_CLOSING]));
    assert!(connections.enter().is_none(), "displaced connections are still open");
    assert_eq!(connections.open(), 32 + MIN_CLOSING);
    slots.remove(1);
    assert!(connections.enter().is_some());
    drop(slots);
    assert_is_empty(&connections);
}

#[test]
fn new_connection_is_not_displaced_before_its_request() {
    let connections = Arc::new(Connections::new(64));
    let mut slots: Vec<_> = (0..63).map(|_| idle_slot(&connections)).collect();
    let newcomers: Vec<_> = (0..6).map(|_| connections.enter().unwrap()).collect();
    let closing: Vec<_> = newcomers.iter().map(|slot| is_closing(slot)).collect();
    assert_eq!(
        closing,
        [true, false, false, false, false, false],
        "five without a request are more than the reserve"
    );
    assert!(is_closing(&slots[0]) && is_closing(&slots[3]) && !is_closing(&slots[4]));
    slots.clear();
    drop(newcomers);
    assert_is_empty(&connections);
}

#[test]
fn some_slots_are_reserved_for_workers() {
    let connections = Arc::new(Connections::new(64));
    let slots: Vec<_> = (0..64).map(|_| idle_slot(&connections)).collect();
    let mut permits: Vec<_> = slots[..60].iter().map(|slot| slot.begin("/").ok().unwrap()).collect();
    for (slot, path) in slots[60..].iter().zip(["/v1/results", "/v1/workers/7/heartbeat"]) {
        assert!(slot.begin("/v1/workers/7/drain").is_err(), "not a path of workers");
        permits.push(slot.begin(path).ok().unwrap());
    }
    assert_eq!(slots[62].begin("/v1/jobs/7/attempts/1/result").err().map(|refused| refused.limit), Some(62));
    drop((permits, slots));
    assert_is_empty(&connections);
}
