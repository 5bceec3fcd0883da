//! Meshes: upload, identity by content, use in submissions.

use reqwest::header::{CACHE_CONTROL, CONTENT_LENGTH, CONTENT_TYPE, ETAG, IF_NONE_MATCH};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::stl::{ascii, binary, block, wall};
use super::test_server::*;

const NO_MESH: &str = "00000000000000000000000000000000000000000000000000000000000000ff";

async fn upload(server: &TestServer, file: Vec<u8>) -> TestResponse {
    server.send_text("/v1/meshes", "model/stl", file).await
}

/// Uploads a new file and returns its digest.
async fn digest_of(server: &TestServer, file: Vec<u8>) -> String {
    text(&upload(server, file).await.expect(StatusCode::CREATED)["digest"]).to_owned()
}

/// The small scenario with a product from a mesh.
fn with_mesh(digest: &str) -> Value {
    let mut scenario = scenario(1);
    scenario["product"]["mesh"] = json!({"digest": digest, "units": "mm"});
    scenario
}

#[tokio::test]
async fn file_is_stored_once_and_downloaded_unchanged() {
    let (server, dir) = TestServer::start().await;
    let file = binary(&block([120.0, 60.0, 30.5], 2));
    let answer = upload(&server, file.clone()).await;
    let location = answer.location.clone().unwrap();
    let mesh = answer.expect(StatusCode::CREATED);
    let digest = text(&mesh["digest"]).to_owned();
    assert_eq!(digest, roost_solver::mesh::digest(&file));
    assert_eq!(location, format!("/v1/meshes/{digest}"));
    let expected = json!({
        "digest": digest, "bytes": 84 + 50 * 48, "format": "binary", "triangles": 48, "degenerate": 0,
        "closed": true, "open_edges": 0, "turned_edges": 0, "low": [0.0, 0.0, 0.0],
        "high": [120.0, 60.0, 30.5], "size": [120.0, 60.0, 30.5], "uploaded_at": mesh["uploaded_at"],
    });
    assert_eq!(mesh, expected);
    let again = server.send_text("/v1/meshes", "application/octet-stream; x=y", file.clone()).await;
    assert_eq!(again.expect(StatusCode::OK), mesh, "the first time");
    server.stop().await;

    let server = TestServer::on(dir.path(), |_| {}).await;
    assert_eq!(server.get(&location).await.expect(StatusCode::OK), mesh);
    let url = format!("http://{}{location}/file", server.address);
    let response = server.http.get(&url).send().await.unwrap();
    let header = |name| response.headers()[name].to_str().unwrap().to_owned();
    assert_eq!(header(CONTENT_TYPE), "model/stl");
    assert_eq!(header(CONTENT_LENGTH), file.len().to_string());
    assert!(header(CACHE_CONTROL).contains("immutable"));
    let etag = header(ETAG);
    assert_eq!(response.bytes().await.unwrap(), file);
    for (known, status) in [(etag.as_str(), 304), ("\"other\"", 200), ("*", 304)] {
        let response = server.http.get(&url).header(IF_NONE_MATCH, known).send().await.unwrap();
        assert_eq!(response.status(), status, "{known}");
        assert_eq!(response.bytes().await.unwrap().is_empty(), status == 304, "{known}");
    }
    server.stop().await;
}

#[tokio::test]
async fn open_edges_and_degenerate_triangles_of_a_file_are_reported() {
    let (server, _dir) = TestServer::start().await;
    // A wall in metres with a triangle without an area: in millimetres its size would be 0.8 mm.
    let mut triangles = wall(0.5, 0.8);
    triangles.push([[0.0; 3], [0.0, 0.5, 0.0], [0.0, 0.25, 0.0]]);
    let mesh = upload(&server, ascii(&triangles)).await.expect(StatusCode::CREATED);
    assert_eq!(
        (&mesh["format"], &mesh["triangles"], &mesh["degenerate"]),
        (&json!("ascii"), &json!(3), &json!(1))
    );
    assert_eq!((&mesh["closed"], &mesh["size"]), (&json!(false), &json!([0.0, 0.5, 0.8])));
    assert!(mesh["open_edges"].as_u64().unwrap() >= 4, "{mesh}");
    let mut turned = block([10.0; 3], 1);
    turned[0].swap(0, 1);
    let mesh = upload(&server, binary(&turned)).await.expect(StatusCode::CREATED);
    assert_eq!((&mesh["closed"], &mesh["turned_edges"]), (&json!(true), &json!(3)));
    server.stop().await;
}

#[tokio::test]
async fn long_file_is_downloaded_completely() {
    let (server, _dir) = TestServer::start().await;
    // A little more than three parts.
    let file = binary(&block([100.0; 3], 75));
    assert!(file.len() > 3 * 1024 * 1024, "{}", file.len());
    let digest = digest_of(&server, file.clone()).await;
    let url = format!("http://{}/v1/meshes/{digest}/file", server.address);
    assert!(server.http.get(&url).send().await.unwrap().bytes().await.unwrap() == file);
    server.stop().await;
}

#[tokio::test]
async fn meshes_are_listed_newest_first_in_pages() {
    let (server, _dir) = TestServer::start().await;
    let mut digests = Vec::new();
    for height in [10.0, 20.0, 30.0] {
        digests.push(digest_of(&server, binary(&wall(10.0, height))).await);
    }
    let page = async |query: &str| server.get(&format!("/v1/meshes?{query}")).await.expect(StatusCode::OK);
    let listed = |page: &Value| -> Vec<String> {
        page["items"].as_array().unwrap().iter().map(|mesh| text(&mesh["digest"]).to_owned()).collect()
    };
    let first = page("limit=2").await;
    assert_eq!(listed(&first), [digests[2].clone(), digests[1].clone()]);
    let rest = page(&format!("limit=2&cursor={}", text(&first["next_cursor"]))).await;
    assert_eq!((listed(&rest), &rest["next_cursor"]), (vec![digests[0].clone()], &json!(null)));
    server.get("/v1/meshes?limit=0").await.problem(400, "invalid-query");
    server.stop().await;
}

#[tokio::test]
async fn invalid_file_is_refused_with_the_reason() {
    let (server, _dir) = TestServer::with(|config| config.max_mesh_bytes = 3000).await;
    let sound = binary(&block([10.0; 3], 1));
    for (file, part) in [
        (Vec::new(), "the file is empty"),
        (b"chicken".to_vec(), "neither a binary STL"),
        (sound[..600].to_vec(), "cut short"),
        (binary(&[]), "no triangle"),
        (binary(&wall(f32::NAN, 1.0)), "NaN"),
        (binary(&wall(1e-6, 1e-6)), "are the units right?"),
        (binary(&wall(1e6, 1e6)), "are the units right?"),
    ] {
        let problem = upload(&server, file).await.problem(422, "invalid-mesh");
        assert!(text(&problem["detail"]).contains(part), "{part}: {problem}");
    }
    let problem = upload(&server, binary(&block([10.0; 3], 3))).await.problem(413, "too-large");
    assert!(text(&problem["detail"]).contains("3000 bytes"), "{problem}");
    for declared in ["application/json", "text/plain", ""] {
        let problem = server.send_text("/v1/meshes", declared, sound.clone()).await.problem(415, "not-stl");
        assert!(text(&problem["detail"]).contains("model/stl"), "{problem}");
    }
    assert_eq!(server.get("/v1/meshes").await.expect(StatusCode::OK)["items"], json!([]), "nothing stored");
    for path in [format!("/v1/meshes/{NO_MESH}"), format!("/v1/meshes/{NO_MESH}/file")] {
        server.get(&path).await.problem(404, "not-found");
        server.get(&path.replace("ff", "FF")).await.problem(400, "invalid-path");
        server.get(&path.replace("ff", "")).await.problem(400, "invalid-path");
    }
    server
        .send(Method::DELETE, &format!("/v1/meshes/{NO_MESH}"), None)
        .await
        .problem(405, "method-not-allowed");
    server.stop().await;
}

/// Clients that stop in the middle of a request.
#[tokio::test]
async fn stalled_uploads_do_not_block_others() {
    use tokio::io::AsyncWriteExt;
    let (server, _dir) = TestServer::start().await;
    let mut stalled = Vec::new();
    for _ in 0..4 {
        let mut stream = tokio::net::TcpStream::connect(server.address).await.unwrap();
        let head = "POST /v1/meshes HTTP/1.1\r\nhost: x\r\ncontent-type: model/stl\r\ncontent-length: 684\r\n\r\nsolid";
        stream.write_all(head.as_bytes()).await.unwrap();
        stalled.push(stream);
    }
    // Their heads have arrived before this request.
    tokio::time::sleep(std::time::Duration::from_millis(100)).await;
    let sent = upload(&server, binary(&block([10.0; 3], 1)));
    let answer = tokio::time::timeout(std::time::Duration::from_secs(20), sent).await.expect("an answer");
    answer.expect(StatusCode::CREATED);
    drop(stalled);
    server.stop().await;
}

#[tokio::test]
async fn submission_with_unknown_mesh_is_refused() {
    let (server, _dir) = TestServer::start().await;
    let file = binary(&block([120.0, 60.0, 30.0], 1));
    let digest = roost_solver::mesh::digest(&file);
    let job = json!({"scenario": with_mesh(&digest)});
    let mut surfaces = scenario(1);
    let mesh = json!({"digest": digest, "units": "mm"});
    surfaces["equipment"] = json!({"surfaces": [
        {"name": "plate", "plate_m": [[-1.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]},
        {"name": "wall", "mesh": mesh, "position_m": [-1.0, 0.0, 1.0]},
    ]});
    let sweep = |base: Value| {
        json!({"name": "s", "base": base, "design": {"kind": "grid"}, "factors": [
        {"pointer": "/product/mesh", "levels": [null, mesh]},
        {"pointer": "/equipment/gate_opening_m", "levels": [0.05, 0.06]}]})
    };
    let cases = [
        ("/v1/jobs", job.clone(), "/scenario/product/mesh/digest", StatusCode::ACCEPTED),
        (
            "/v1/jobs",
            json!({"scenario": surfaces}),
            "/scenario/equipment/surfaces/1/mesh/digest",
            StatusCode::ACCEPTED,
        ),
        ("/v1/sweeps", sweep(with_mesh(&digest)), "/base/product/mesh/digest", StatusCode::CREATED),
        ("/v1/sweeps", sweep(scenario(2)), "/factors/0/levels/1/digest", StatusCode::CREATED),
        ("/v1/validate", with_mesh(&digest), "/product/mesh/digest", StatusCode::OK),
        ("/v1/validate", job, "/scenario/product/mesh/digest", StatusCode::OK),
    ];
    for (path, document, pointer, _) in &cases {
        let problem = server.post(path, document).await.problem(422, "invalid-document");
        let errors = problem["errors"].as_array().unwrap();
        assert_eq!((errors.len(), &errors[0]["pointer"]), (1, &json!(pointer)), "{path}: {problem}");
        assert_eq!(errors[0]["value"], digest);
        assert!(text(&errors[0]["allowed"]).contains("POST /v1/meshes"), "{problem}");
    }
    for path in ["/v1/jobs", "/v1/sweeps"] {
        assert_eq!(server.get(path).await.expect(StatusCode::OK)["items"], json!([]), "nothing stored");
    }
    digest_of(&server, file).await;
    for (path, document, _, status) in &cases {
        server.post(path, document).await.expect(*status);
    }
    let worker = server.worker("cpu").await;
    assert_eq!(worker.claim_one().await["scenario"]["product"]["mesh"], mesh, "the worker sees the digest");

    // In metres it would be 120 m long, above the limit.
    let mut wrong = with_mesh(&digest);
    wrong["product"]["mesh"]["units"] = json!("m");
    let problem = server.post("/v1/jobs", &json!({"scenario": wrong})).await.problem(422, "invalid-document");
    assert_eq!(problem["errors"][0]["pointer"], "/scenario/product/mesh/units", "{problem}");
    server.stop().await;
}

#[tokio::test]
async fn validation_reports_each_mesh() {
    let (server, _dir) = TestServer::start().await;
    let small = digest_of(&server, binary(&block([120.0, 60.0, 30.0], 1))).await;
    let large = digest_of(&server, binary(&block([150.0, 80.0, 30.0], 1))).await;
    let level = |digest: &str| json!({"digest": digest, "units": "mm"});
    let sweep = json!({"name": "s", "base": with_mesh(&small), "design": {"kind": "grid"}, "factors": [
        {"pointer": "/product/mesh", "levels": [level(&small), level(&large)]}]});
    let report = server.post("/v1/validate", &sweep).await.expect(StatusCode::OK);
    let meshes = report["meshes"].as_array().unwrap();
    assert_eq!(meshes.len(), 2, "each once: {report}");
    assert_eq!(
        meshes[1],
        json!({"pointer": "/product/mesh", "digest": large, "units": "mm", "triangles": 12, "degenerate": 0,
               "size_m": [0.15, 0.08, 0.03], "placed_m": null, "closed": true, "open_edges": 0, "turned_edges": 0})
    );
    server.stop().await;
}

#[tokio::test]
async fn validation_reports_where_a_mesh_lies() {
    let (server, _dir) = TestServer::start().await;
    let wall = digest_of(&server, binary(&wall(200.0, 300.0))).await;
    let mut document = scenario(1);
    document["equipment"]["surfaces"] = json!([
        {"name": "turned", "mesh": {"digest": wall, "units": "mm"}, "position_m": [0.5, 0.1, -0.3], "orientation_deg": [90, 0, 0],
         "motion": "moving", "spin_deg_s": [0, 0, 10], "pivot_m": [2, 2, 2]},
        {"name": "next", "mesh": {"digest": wall, "units": "mm"}, "position_m": [0.7, 0, 0]}]);
    let report = server.post("/v1/validate", &document).await.expect(StatusCode::OK);
    assert_eq!(report["meshes"].as_array().unwrap().len(), 1, "{report}");
    // A quarter turn moves +y to -x, before the move.
    assert_eq!(report["meshes"][0]["placed_m"], json!([[0.3, 0.1, -0.3], [0.5, 0.1, 0.0]]), "{report}");
    server.stop().await;
}

#[tokio::test]
async fn triangles_of_a_document_are_limited() {
    let (server, _dir) = TestServer::with(|config| config.max_mesh_triangles = 20).await;
    let mut digests = Vec::new();
    for length in [100.0, 110.0, 120.0] {
        digests.push(digest_of(&server, binary(&block([length, 60.0, 30.0], 1))).await);
    }
    // One document at a time, the cache has room for all meshes.
    for digest in digests.iter().chain(&digests) {
        server.post("/v1/validate", &with_mesh(digest)).await.expect(StatusCode::OK);
    }
    let levels: Vec<_> = digests.iter().map(|digest| json!({"digest": digest, "units": "mm"})).collect();
    let sweep = json!({"name": "s", "base": scenario(1), "design": {"kind": "grid"}, "factors": [
        {"pointer": "/product/mesh", "levels": levels}]});
    let problem = server.post("/v1/sweeps", &sweep).await.problem(422, "invalid-document");
    assert_eq!(problem["errors"][0]["pointer"], "/factors/0/levels/1/digest", "{problem}");
    assert!(text(&problem["errors"][0]["allowed"]).contains("at most 20 (max_mesh_triangles)"), "{problem}");
    server.stop().await;
}
