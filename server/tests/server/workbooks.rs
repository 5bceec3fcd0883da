//! The results of a sweep for people: workbooks of Excel, and CSV with short names and a line of units.

use std::io::Cursor;

use calamine::{Data, Range, Reader, Xlsx};
use reqwest::StatusCode;
use serde_json::{Value, json};

use super::studies::{question, submit, work};
use super::test_server::*;

const MEDIA_TYPE: &str = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet";

/// Two points with two replicates; of the last point one run is unstable and one is queued.
async fn run_sweep(server: &TestServer) -> String {
    let document = json!({"name": "gates", "base": scenario(10), "design": {"kind": "grid"}, "replicates": 2,
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.05]}]});
    let view = server.post("/v1/sweeps", &document).await.expect(StatusCode::CREATED);
    let worker = server.worker("cpu").await;
    let attempts = worker.claim(3).await;
    for (attempt, codes) in attempts.iter().zip(["thin_fillet, dense_bed", "none"]) {
        let mut result = result_of(&attempt["scenario"]);
        result.responses.insert("warning_codes".to_owned(), json!(codes));
        worker.deliver_result(attempt, &result).await.expect(StatusCode::OK);
    }
    worker.fail(&attempts[2], "unstable", None).await.expect(StatusCode::OK);
    format!("/v1/sweeps/{}/results", text(&view["id"]))
}

async fn workbook(server: &TestServer, path: &str) -> Xlsx<Cursor<Vec<u8>>> {
    let answer = server.http.get(format!("http://{}{path}", server.address)).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    assert_eq!(answer.headers()["content-type"], MEDIA_TYPE);
    let length: usize = answer.headers()["content-length"].to_str().unwrap().parse().unwrap();
    let bytes = answer.bytes().await.unwrap();
    assert_eq!(bytes.len(), length);
    Xlsx::new(Cursor::new(bytes.to_vec())).unwrap()
}

/// The cells of a column below its header.
fn column(sheet: &Range<Data>, name: &str) -> Vec<Data> {
    let head = sheet.rows().next().unwrap();
    let place = head.iter().position(|cell| cell == name).unwrap_or_else(|| panic!("{name} of {head:?}"));
    sheet.rows().skip(1).map(|row| row[place].clone()).collect()
}

fn words(cells: &[Data]) -> Vec<String> {
    cells.iter().map(ToString::to_string).collect()
}

#[tokio::test]
async fn workbook_has_points_jobs_and_units() {
    let (server, folder) = TestServer::start().await;
    let path = run_sweep(&server).await;
    let json = server.get(&format!("{path}?by=point")).await.expect(StatusCode::OK);
    let mut book = workbook(&server, &format!("{path}?format=xlsx")).await;
    assert_eq!(book.sheet_names(), ["points", "jobs", "units"], "no study, no answer");

    let points = book.worksheet_range("points").unwrap();
    assert_eq!(column(&points, "gate_opening_m"), [0.045, 0.05].map(Data::Float));
    assert_eq!(column(&points, "unstable"), [0.0, 1.0].map(Data::Float));
    let mean = json["points"][0]["responses"]["discharged_kg"]["mean"].as_f64().unwrap();
    assert_eq!(column(&points, "discharged_kg.mean"), [Data::Float(mean), Data::Empty]);

    let jobs = book.worksheet_range("jobs").unwrap();
    assert_eq!(words(&column(&jobs, "state")), ["succeeded", "succeeded", "failed", "queued"]);
    assert_eq!(column(&jobs, "seed"), [10.0, 11.0, 10.0, 11.0].map(Data::Float));
    assert_eq!(words(&column(&jobs, "failure_class")), ["", "", "unstable", ""]);
    assert_eq!(words(&column(&jobs, "regime")), ["constant", "constant", "", ""]);
    assert_eq!(words(&column(&jobs, "warning_codes")), ["thin_fillet, dense_bed", "none", "", ""]);
    let discharged = column(&jobs, "discharged_kg");
    assert!(matches!(discharged[..2], [Data::Float(_), Data::Float(_)]), "{discharged:?}");

    let head = words(jobs.rows().next().unwrap());
    let place = |name: &str| head.iter().position(|other| other == name).expect(name);
    assert!(place("regime") < place("discharged_kg"), "in the order of the table of responses: {head:?}");

    let units = book.worksheet_range("units").unwrap();
    let names = words(&column(&units, "column"));
    let heads = points.rows().next().unwrap().iter().chain(jobs.rows().next().unwrap());
    assert_eq!(names, heads.map(ToString::to_string).collect::<Vec<_>>(), "every column of both sheets");
    let gate = names.iter().position(|name| name == "gate_opening_m").unwrap();
    assert_eq!(words(&column(&units, "unit"))[gate], "m");
    assert_eq!(words(&column(&units, "field"))[gate], "/equipment/gate_opening_m");
    assert!(words(&column(&units, "meaning")).iter().all(|meaning| meaning.len() > 10));

    let mut book = workbook(&server, &format!("{path}?format=xlsx&names=pointer&responses=regime")).await;
    let head = words(book.worksheet_range("jobs").unwrap().rows().next().unwrap());
    assert_eq!(head[4], "/equipment/gate_opening_m");
    assert_eq!(head.last().unwrap(), "regime");
    let rest: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(rest.iter().all(|name| !name.to_string_lossy().starts_with(".tmp")), "{rest:?}");
    server.stop().await;
}

#[tokio::test]
async fn workbook_of_a_study_has_its_answer() {
    let (server, _dir) = TestServer::start().await;
    let id = submit(&server, &question(40)).await;
    work(&server, &id, 8).await;
    let mut book = workbook(&server, &format!("/v1/sweeps/{id}/results?format=xlsx")).await;
    let study = server.get(&format!("/v1/studies/{id}")).await.expect(StatusCode::OK);
    assert_eq!(book.sheet_names(), ["points", "jobs", "units", "answer"]);
    let answer = book.worksheet_range("answer").unwrap();
    let parts = words(&column(&answer, "part"));
    let sentences = words(&column(&answer, "text"));
    assert_eq!((&parts[0], sentences[0].as_str()), (&"question".to_owned(), text(&study["question"])));
    let of = |part: &str| parts.iter().zip(&sentences).find(|(name, _)| *name == part).map(|(_, text)| text);
    assert!(of("evidence").unwrap().starts_with("The answer rests on"), "{parts:?}");
    assert!(of("assumptions").unwrap().starts_with("It holds for"), "{parts:?}");
    assert!(of("answer").unwrap().contains("jammed"), "{sentences:?}");
    assert_eq!(parts.last().unwrap(), "state");
    server.stop().await;
}

#[tokio::test]
async fn csv_has_short_names_and_units_if_asked() {
    let (server, _dir) = TestServer::start().await;
    let path = run_sweep(&server).await;
    let text =
        server.get(&format!("{path}?format=csv&names=short&units=true&responses=discharged_kg")).await.text;
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(
        lines[0],
        "job_id,point,replicate,seed,gate_opening_m,state,failure_class,backend,solver_revision,discharged_kg"
    );
    assert_eq!(lines[1], ",,,,m,,,,,kg");
    assert_eq!(lines.len(), 6, "{text}");
    let text =
        server.get(&format!("{path}?format=csv&by=point&units=true&responses=discharged_kg")).await.text;
    assert!(text.starts_with("point,/equipment/gate_opening_m,trials,"), "{text}");
    assert!(text.lines().nth(1).unwrap().ends_with(",,kg,kg,kg,kg"), "no unit for n: {text}");
    let parquet = server.http.get(format!("http://{}{path}?format=parquet&names=short", server.address));
    let bytes = parquet.send().await.unwrap().bytes().await.unwrap();
    let has = |name: &[u8]| bytes.windows(name.len()).any(|window| window == name);
    assert!(has(b"gate_opening_m") && !has(b"/equipment/gate_opening_m"));
    assert!(has(br#""discharged_kg":"kg""#) && has(br#""gate_opening_m":"m""#), "units in the metadata");
    for query in [
        "names=short",
        "units=true",
        "format=parquet&units=true",
        "format=xlsx&units=true",
        "format=xlsx&limit=2",
        "format=xlsx&cursor=0.1",
        "format=csv&names=long",
        "format=xls",
    ] {
        let problem: Value = server.get(&format!("{path}?{query}")).await.problem(400, "invalid-query");
        assert!(problem["detail"].as_str().unwrap().len() > 20, "{problem}");
    }
    server.stop().await;
}
