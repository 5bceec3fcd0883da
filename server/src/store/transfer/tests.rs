//! Tests of copies: there and back, and what they refuse.

use super::*;
use crate::store::Store;
use crate::store::simulation::run_seed;
use crate::store::testing::Place;
use crate::store::versions::Subject;

/// Rows that the simulation does not make.
const OTHERS: &str = "
    INSERT INTO sweeps (id, name, spec, factors, labels, points, replicates, submitted_at)
    VALUES ('s', 'Hähnchen', '{}', '[]', '{}', 1, 1, 0);
    INSERT INTO studies (sweep_id, spec, question, max_runs) VALUES ('s', '{}', 'q', 9);
    INSERT INTO observations (study_id, number, source, state, levels, replicate, seed, expires_at)
    VALUES ('s', 1, 'asked', 'handed_out', '{}', 0, 1, 5), ('s', 2, 'asked', 'handed_out', '{}', 0, 2, 5);
    UPDATE observations SET state = 'done', responses = '{\"a\": 0.1}' WHERE number = 1;
    INSERT INTO asks (request_id, study_id, numbers, jobs) VALUES ('r', 's', '[1]', '[]');
    INSERT INTO deletions (sweep_id, name, deleted_at) VALUES ('gone', 'n', 0);
    INSERT INTO tokens (id, name, hash, scopes, created_at) VALUES ('t', 'n', 'h', '[]', 0);
    INSERT INTO extensions (id, sweep_id, body, points_before, replicates_before, extended_at) VALUES ('e', 's', '{}', 1, 1, 0);
    INSERT INTO submissions (token_id, key, fingerprint, resource_id, created_at) VALUES ('', 'k', 'f', 'r', 0);
    DELETE FROM deletions";

/// PostgreSQL notes the numbers of deleted events alone.
#[tokio::test]
async fn a_copy_of_postgresql_continues_the_numbers_of_its_events() {
    let (first, second) = (Place::postgres(), Place::postgres());
    let store = first.open().await;
    run_seed(&store, 0, false).await;
    let newest = store.event_range().await.unwrap().1;
    let before = versions(&store).await;
    store.close().await;
    transfer(&first.location, &second.location).await.unwrap();
    let store = second.open().await;
    assert_eq!((store.event_range().await.unwrap().1, versions(&store).await), (newest, before));
    let next = "INSERT INTO events (at, job_id, state, attempt, cancelling) VALUES (0, 'j', 'queued', 0, 0) RETURNING seq";
    let next = store
        .writer
        .write(move |tx| Box::pin(async move { Ok(query_scalar::<i64>(next).fetch_one(tx).await?) }));
    assert_eq!(next.await.unwrap(), newest + 1);
    store.close().await;
}

async fn versions(store: &Store) -> Vec<Option<String>> {
    let mut versions = Vec::new();
    for subject in [Subject::Everything, Subject::Studies, Subject::Workers, Subject::Meshes] {
        versions.push(store.version(subject).await.unwrap());
    }
    versions
}

#[tokio::test]
async fn a_copy_there_and_back_has_equal_tables() {
    let (first, middle, last) = (Place::sqlite(), Place::postgres(), Place::sqlite());
    let store = first.open().await;
    for seed in 0..5 {
        run_seed(&store, seed, false).await;
    }
    let parts = "INSERT INTO mesh_parts (digest, part, data) VALUES ('m', ?, ?)";
    let mesh = "INSERT INTO meshes (digest, bytes, format, triangles, degenerate, open_edges, turned_edges, low, high, size, uploaded_at)
                VALUES ('m', 3, 'ascii', 1, 0, 0, 0, '[]', '[]', '[]', 7)";
    let write = store.writer.write(move |tx| {
        Box::pin(async move {
            raw_sql(OTHERS).execute(&mut *tx).await?;
            raw_sql(mesh).execute(&mut *tx).await?;
            for part in 0..3 {
                query(parts).bind(part).bind(vec![part as u8; 3 << 20]).execute(&mut *tx).await?;
            }
            Ok(())
        })
    });
    write.await.unwrap();
    let before = versions(&store).await;
    store.close().await;

    let there = transfer(&first.location, &middle.location).await.unwrap();
    assert!(there.iter().filter(|copied| copied.rows > 0).count() > 15, "{there:?}");
    let full = transfer(&first.location, &middle.location).await;
    assert!(matches!(full, Err(StoreError::NotEmpty(_))), "{full:?}");
    let back = transfer(&middle.location, &last.location).await.unwrap();
    assert_eq!(back, there);

    for place in [&middle, &last] {
        let store = place.open().await;
        assert_eq!(versions(&store).await, before, "{:?}", place.location);
        let in_use = transfer(&place.location, &Place::sqlite().location).await;
        if let Location::Postgres(_) = place.location {
            assert!(matches!(in_use, Err(StoreError::OtherServer(_))), "{in_use:?}");
        }
        // The next rows have new numbers.
        let newest = "SELECT seq FROM sqlite_sequence WHERE name = 'deletions'";
        let newest: i64 = query_scalar(newest).fetch_one(&store.readers).await.unwrap();
        let next = "INSERT INTO deletions (sweep_id, name, deleted_at) VALUES ('s', 'n', 0) RETURNING seq";
        let next = store
            .writer
            .write(move |tx| Box::pin(async move { Ok(query_scalar::<i64>(next).fetch_one(tx).await?) }));
        assert_eq!(next.await.unwrap(), newest + 1);
        store.close().await;
    }
}
