//! Which connection gives way, and that the counts stay right.

use super::*;

fn is_told(place: &Place) -> bool {
    use futures_util::FutureExt;
    place.leave.notify.notified().now_or_never().is_some()
}

fn count(connections: &Connections, reason: &Refused) -> u64 {
    connections.refused.get_or_create(reason).get()
}

/// A connection that has been asked something, and waits.
fn served(connections: &Arc<Connections>) -> Arc<Place> {
    let place = connections.enter().unwrap();
    drop(place.begin("/v1/jobs").ok().unwrap());
    place.note_written();
    place
}

fn assert_is_empty(connections: &Connections) {
    let table = locked(&connections.table);
    assert_eq!(
        (table.open, table.answering, table.told, table.unasked, table.waiting.len()),
        (0, 0, 0, 0, 0)
    );
}

#[test]
fn who_never_asked_gives_way_first_and_then_who_is_idle_longest() {
    let connections = Arc::new(Connections::new(4));
    let (first, second) = (served(&connections), served(&connections));
    // It has been there for longer, and been idle for less long.
    drop(first.begin("/v1/jobs").ok().unwrap());
    first.note_written();
    let third = served(&connections);
    let silent = connections.enter().unwrap();
    let fifth = served(&connections);
    assert!(is_told(&silent), "the newest of all, but it has asked for nothing");
    let sixth = served(&connections);
    assert!(is_told(&second) && !is_told(&first) && !is_told(&third), "idle for longest");
    assert_eq!((count(&connections, &NO_REQUEST), count(&connections, &IDLE)), (1, 1));
    assert_eq!(connections.open(), 6, "until those that were told have closed");
    // One that was told may have been asked something at that very moment: that is answered.
    drop(second.begin("/v1/jobs").ok().unwrap());
    drop((first, second, third, silent, fifth, sixth));
    assert_is_empty(&connections);
}

#[test]
fn those_that_never_asked_have_a_quarter_of_the_places() {
    let connections = Arc::new(Connections::new(4000));
    let regular: Vec<_> = (0..4).map(|_| served(&connections)).collect();
    let silent: Vec<_> = (0..1020).map(|_| connections.enter().unwrap()).collect();
    let told = silent.iter().take_while(|place| is_told(place)).count();
    assert_eq!((told, locked(&connections.table).unasked), (20, 1000), "the older ones");
    assert!(!regular.iter().any(|place| is_told(place)));
    drop((regular, silent));
    assert_is_empty(&connections);
}

#[test]
fn a_few_places_are_kept_for_connections_that_wait() {
    let connections = Arc::new(Connections::new(32));
    let places: Vec<_> = (0..32).map(|_| served(&connections)).collect();
    let mut turns: Vec<_> = places[..30].iter().map(|place| place.begin("/").ok().unwrap()).collect();
    assert_eq!(places[30].begin("/").err().map(|refused| refused.limit), Some(30));
    turns.push(places[31].begin("/metrics").ok().expect("that is always answered"));
    assert!(connections.enter().is_none(), "nobody waits, so nobody can give way");
    assert_eq!((count(&connections, &BUSY), count(&connections, &FULL)), (1, 1));
    turns.pop();
    let newest = connections.enter().expect("the one before waits now");
    assert!(is_told(&places[31]));
    drop((places, turns, newest));
    assert_is_empty(&connections);
}

#[test]
fn who_reads_an_answer_gives_way_last_and_few_are_ever_on_their_way_out() {
    let connections = Arc::new(Connections::new(32));
    let mut places: Vec<_> = (0..32).map(|_| served(&connections)).collect();
    drop(places[0].begin("/v1/jobs").ok().unwrap());
    for _ in 0..ALWAYS_TOLD {
        places.push(served(&connections));
    }
    assert!(!is_told(&places[0]) && is_told(&places[1]) && is_told(&places[ALWAYS_TOLD]));
    assert!(connections.enter().is_none(), "those that were told are still open");
    assert_eq!(connections.open(), 32 + ALWAYS_TOLD);
    places.remove(1);
    assert!(connections.enter().is_some());
    drop(places);
    assert_is_empty(&connections);
}

#[test]
fn a_newcomer_is_not_displaced_before_it_can_ask() {
    let connections = Arc::new(Connections::new(64));
    let mut places: Vec<_> = (0..63).map(|_| served(&connections)).collect();
    let newcomers: Vec<_> = (0..6).map(|_| connections.enter().unwrap()).collect();
    let told: Vec<_> = newcomers.iter().map(|place| is_told(place)).collect();
    assert_eq!(told, [true, false, false, false, false, false], "five wait when the sixth comes");
    assert!(is_told(&places[0]) && is_told(&places[3]) && !is_told(&places[4]));
    places.clear();
    drop(newcomers);
    assert_is_empty(&connections);
}

#[test]
fn workers_are_answered_on_some_places_of_their_own() {
    let connections = Arc::new(Connections::new(64));
    let places: Vec<_> = (0..64).map(|_| served(&connections)).collect();
    let mut turns: Vec<_> = places[..60].iter().map(|place| place.begin("/").ok().unwrap()).collect();
    for (place, path) in places[60..].iter().zip(["/v1/claims", "/v1/workers/7/heartbeat"]) {
        assert!(place.begin("/v1/workers/7/drain").is_err(), "that is not for workers");
        turns.push(place.begin(path).ok().unwrap());
    }
    assert_eq!(places[62].begin("/v1/jobs/7/attempts/1/result").err().map(|refused| refused.limit), Some(62));
    drop((turns, places));
    assert_is_empty(&connections);
}
