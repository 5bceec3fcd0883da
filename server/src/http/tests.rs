//! The table of problems in `api.md` against the one in the code, what becomes of a panic, and how much is kept in memory.

use serde_json::json;

use super::at_hand::at_hand;
use super::problem::Kind;
use crate::{Server, ServerConfig};

#[tokio::test]
async fn a_panic_is_a_problem_document_without_its_message() {
    let response = super::panicked(Box::new("the inside of the server"));
    assert_eq!(response.status(), 500);
    assert_eq!(response.headers()["content-type"], "application/problem+json");
    let body = axum::body::to_bytes(response.into_body(), 10_000).await.unwrap();
    let text = str::from_utf8(&body).unwrap();
    assert!(text.contains("/problems/internal") && !text.contains("the inside"), "{text}");
}

#[test]
fn api_md_lists_every_kind_of_problem_with_its_status() {
    let text = include_str!("../../../api.md");
    let rows: Vec<_> = text.lines().filter(|line| line.starts_with("| `/problems/")).collect();
    for kind in Kind::ALL {
        let row = format!("| `{}` | {} |", kind.uri(), kind.status().as_u16());
        assert!(rows.iter().any(|line| line.starts_with(&row)), "{row}");
    }
    assert_eq!(rows.len(), Kind::ALL.len());
}

/// An STL file of one triangle, as large as that.
fn triangle(side: f32) -> Vec<u8> {
    let mut file = vec![0; 80];
    file.extend(1_u32.to_le_bytes());
    file.extend([0; 12]);
    [0.0, 0.0, 0.0, side, 0.0, 0.0, 0.0, side, 0.0]
        .iter()
        .for_each(|number| file.extend(number.to_le_bytes()));
    file.extend([0; 2]);
    file
}

#[tokio::test]
async fn meshes_are_read_once_and_no_more_are_kept_than_one_document_may_name() {
    let dir = tempfile::tempdir().unwrap();
    let config = ServerConfig {
        listen: ([127, 0, 0, 1], 0).into(),
        data: dir.path().to_owned(),
        max_mesh_triangles: 2,
        ..ServerConfig::default()
    };
    let app = Server::bind(config).await.unwrap().app;
    let mut digests = Vec::new();
    for side in [10.0, 20.0, 30.0] {
        let mesh = crate::mesh::read(&triangle(side), app.clock.now()).unwrap();
        digests.push(mesh.digest.clone());
        app.store.insert_mesh(mesh, &triangle(side)).await.unwrap();
    }
    for (named, kept) in [(&digests[..1], 1), (&digests[..2], 2), (&digests[1..2], 2), (&digests[2..], 1)] {
        let before = app.shelf.lock().await.meshes.get(&named[0]);
        let meshes = at_hand(&app, &json!({"mesh": named})).await.unwrap();
        assert!(named.iter().all(|digest| meshes.get(digest).is_some()), "{named:?}");
        assert_eq!(app.shelf.lock().await.triangles, kept, "{named:?}");
        if let Some(before) = before {
            assert!(std::sync::Arc::ptr_eq(&before, &meshes.get(&named[0]).unwrap()), "read again");
        }
    }
    assert!(app.shelf.lock().await.meshes.get(&digests[0]).is_none(), "forgotten");
    app.store.close().await;
}
