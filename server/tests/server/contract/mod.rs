//! Every answer has a status, a media type and a body that `/openapi.json` documents for its operation, and
//! none is 500.
//!
//! Valid and invalid requests are generated from the specification. `ROOST_SEED` selects others,
//! `ROOST_ROUNDS` their number.

mod checking;
mod generating;

use std::collections::{BTreeMap, HashMap};
use std::time::Duration;

use reqwest::{Method, Url};
use roost_api::frames;
use serde_json::{Value, json};

use super::stl;
use super::test_server::*;
use checking::{AnswerChecker, CheckedAnswer};
use generating::ValueGenerator;

/// Default number of requests per operation.
const ROUNDS: u64 = 40;

/// One operation of the specification.
struct Operation {
    method: Method,
    path: String,
    about: Value,
}

fn operations(spec: &Value) -> Vec<Operation> {
    let paths = spec["paths"].as_object().unwrap();
    let each = |(path, item): (&String, &Value)| {
        let methods = item.as_object().unwrap().iter();
        let operation = |(method, about): (&String, &Value)| Operation {
            method: method.to_uppercase().parse().unwrap(),
            path: path.clone(),
            about: about.clone(),
        };
        methods.map(operation).collect::<Vec<_>>()
    };
    paths.iter().flat_map(each).collect()
}

/// Sends generated requests.
struct RequestSender<'f> {
    server: &'f TestServer,
    maker: ValueGenerator,
    tags: HashMap<Url, String>,
}

impl RequestSender<'_> {
    async fn ask(&mut self, operation: &Operation) -> (String, CheckedAnswer) {
        let is_invalid = self.maker.one_in(3);
        let mut url = Url::parse(&format!("http://{}", self.server.address)).unwrap();
        let parameters = operation.about["parameters"].as_array().cloned().unwrap_or_default();
        let path = operation
            .path
            .trim_start_matches('/')
            .split('/')
            .map(|segment| self.segment(operation, segment, &parameters));
        let path: Vec<String> = path.collect();
        url.path_segments_mut().unwrap().extend(path);
        for parameter in parameters.iter().filter(|parameter| parameter["in"] == "query") {
            let is_needed = parameter["required"] == true && !is_invalid;
            if is_needed || self.maker.one_in(2) {
                let value = self.maker.value_of(parameter["name"].as_str().unwrap(), &parameter["schema"]);
                let value = if is_invalid && self.maker.one_in(3) { self.maker.arbitrary() } else { value };
                url.query_pairs_mut().append_pair(parameter["name"].as_str().unwrap(), &text_of(&value));
            }
        }
        let mut request = self.server.http.request(operation.method.clone(), url.clone());
        for parameter in parameters.iter().filter(|parameter| parameter["in"] == "header") {
            if self.maker.one_in(6) {
                let value = text_of(&self.maker.value(&parameter["schema"], 0));
                if let Ok(value) = reqwest::header::HeaderValue::from_bytes(value.as_bytes()) {
                    request = request.header(parameter["name"].as_str().unwrap(), value);
                }
            }
        }
        // Always drawn, so that requests depend on the seed only.
        let asks_for_news = self.maker.random.bool();
        if let Some(tag) = self.tags.get(&url).filter(|_| asks_for_news) {
            request = request.header("if-none-match", tag);
        }
        let (media_type, body) = self.body(&operation.about["requestBody"]["content"], is_invalid);
        if !media_type.is_empty() {
            request = request.header("content-type", media_type).body(body.clone());
        }
        let said = format!("{} {url}\n{}", operation.method, String::from_utf8_lossy(&body));
        let response = request.send().await.unwrap();
        let header =
            |name: &str| response.headers().get(name).map(|value| value.to_str().unwrap().to_owned());
        let (status, media_type) = (response.status().as_u16(), header("content-type").unwrap_or_default());
        if let Some(tag) = header("etag") {
            self.tags.insert(url, tag);
        }
        // Event streams do not end.
        let is_stream = media_type == "text/event-stream";
        let body = if is_stream { Vec::new() } else { response.bytes().await.unwrap().to_vec() };
        (said, CheckedAnswer { status, media_type, body })
    }

    fn segment(&mut self, operation: &Operation, segment: &str, parameters: &[Value]) -> String {
        let Some(name) = segment.strip_prefix('{').and_then(|rest| rest.strip_suffix('}')) else {
            return segment.to_owned();
        };
        let parameter =
            parameters.iter().find(|parameter| parameter["name"] == name).expect("a documented segment");
        // Identifiers belong to the first segment of the path.
        let pool = if name == "id" { operation.path.split('/').nth(2).unwrap() } else { name };
        let value = if self.maker.one_in(12) {
            self.maker.arbitrary()
        } else {
            self.maker.value_of(pool, &parameter["schema"])
        };
        text_of(&value)
    }

    fn body(&mut self, content: &Value, is_invalid: bool) -> (String, Vec<u8>) {
        let Some(content) = content.as_object() else { return Default::default() };
        let (media_type, about) = self.maker.random.choice(content).unwrap();
        let media_type = match is_invalid && self.maker.one_in(8) {
            true => "text/plain".to_owned(),
            false => media_type.clone(),
        };
        if !media_type.ends_with("json") {
            let mut file = match content.contains_key(frames::MEDIA_TYPE) {
                true => [&frames::MAGIC[..], &[self.maker.random.u8(..); 20]].concat(),
                false => stl::binary(&stl::block([120.0, 60.0, 30.0], self.maker.random.usize(1..3))),
            };
            if is_invalid {
                file.truncate(self.maker.random.usize(0..file.len()));
            }
            return (media_type, file);
        }
        // The schema allows any object; send a document that can be submitted.
        let is_open = about["schema"].get("$ref").is_none();
        let mut value = match is_open {
            true => self.maker.value_of("scenario", &about["schema"]),
            false => self.maker.value(&about["schema"], 0),
        };
        if is_invalid {
            self.maker.change(&mut value);
        }
        let mut text = value.to_string();
        if is_invalid && self.maker.one_in(10) {
            text.truncate((0..text.len() / 2).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0));
        }
        (media_type, text.into_bytes())
    }
}

/// A value in a path, a query or a header.
fn text_of(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Creates jobs in every state, a worker, a sweep and a mesh.
async fn create_objects(server: &TestServer, seed: u64) -> HashMap<&'static str, Vec<Value>> {
    let mesh =
        server.send_text("/v1/meshes", "model/stl", stl::binary(&stl::block([12.0, 6.0, 3.0], 1))).await;
    let worker = server.worker("cpu").await;
    let mut jobs = Vec::new();
    for next in 0..6 {
        let job = json!({"scenario": scenario(10 * seed + next), "priority": seed + 10, "cache": "bypass"});
        jobs.push(server.submit(&job).await["id"].clone());
    }
    let attempts = worker.claim(4).await;
    let stream = frames::MAGIC.to_vec();
    assert_eq!(worker.upload_frames(&attempts[2], "&count=1", stream).await.0, 200);
    assert_eq!(worker.checkpoint(&attempts[2], 1.0, b"a checkpoint").await.status, 200);
    assert_eq!(worker.fill(&attempts[2], b"a fill").await.status, 200);
    worker.deliver(&attempts[0]).await.expect(200.try_into().unwrap());
    let partial = result_of(&attempts[1]["scenario"]);
    worker.fail(&attempts[1], "unstable", Some(&partial)).await.expect(200.try_into().unwrap());
    let result = result_of(&attempts[2]["scenario"]);
    let sweep = json!({"name": "a sweep", "base": scenario(7), "design": {"kind": "grid"},
                       "factors": [{"pointer": "/equipment/belt_speed_m_s", "levels": [0.2, 0.3]}]});
    let mut sweeps = Vec::new();
    for _ in 0..3 {
        sweeps.push(server.post("/v1/sweeps", &sweep).await.expect(201.try_into().unwrap())["id"].clone());
    }
    let goal = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.5}});
    let range = json!([{"pointer": "/equipment/belt_speed_m_s", "low": 0.2, "high": 0.4}]);
    let study = json!({"name": "a study", "base": scenario(7), "factors": range, "goal": goal, "budget": {"max_runs": 20}});
    let mut studies = Vec::new();
    for _ in 0..3 {
        studies.push(server.post("/v1/studies", &study).await.expect(201.try_into().unwrap())["id"].clone());
    }
    // The job that runs most often, for heartbeats and deliveries.
    jobs.extend([&attempts[2]["job_id"], &attempts[2]["job_id"], &attempts[3]["job_id"]].map(Value::clone));
    // The job that failed, for retries: most others cannot be retried.
    jobs.extend(std::iter::repeat_n(&attempts[1]["job_id"], 4).cloned());
    HashMap::from([
        ("job_id", jobs.clone()),
        ("jobs", jobs),
        ("sweeps", sweeps),
        ("studies", studies),
        ("goal", vec![goal]),
        ("budget", vec![json!({"max_runs": 20})]),
        ("max_runs", vec![json!(30)]),
        ("ranges", vec![json!([{"pointer": "/equipment/belt_speed_m_s", "low": 0.1}])]),
        ("expires_s", vec![json!(60)]),
        (
            "outcomes",
            vec![
                json!([{"values": {"/equipment/belt_speed_m_s": 0.3}, "seed": 5, "responses": {"jammed": 0}}]),
            ],
        ),
        ("seeded_by", vec![json!([])]),
        (
            "posterior",
            vec![
                Value::Null,
                json!({"parameters": ["/contact/fillet_belt/static_friction"], "samples": [[0.4], [0.5]]}),
            ],
        ),
        ("driver", vec![json!("server"), json!("client")]),
        ("from", vec![json!(0)]),
        ("to", vec![json!(1)]),
        ("workers", vec![json!(worker.id)]),
        ("worker_id", vec![json!(worker.id)]),
        ("digest", vec![mesh.body["digest"].clone()]),
        ("name", vec![json!("discharged_mass")]),
        ("n", vec![json!(1)]),
        ("attempt", vec![json!(1)]),
        ("result", vec![json!(result)]),
        ("outcome", vec![json!("released"), json!("worker")]),
        ("scenario", vec![scenario(1), scenario(20), scenario(21), json!({"experiment": "bend"})]),
        ("base", vec![scenario(7)]),
        ("design", vec![json!({"kind": "grid"}), json!({"kind": "sobol", "points": 2})]),
        (
            "factors",
            vec![
                sweep["factors"].clone(),
                json!([{"pointer": "/product/count", "low": 2, "high": 4}]),
                range,
            ],
        ),
        ("needs", vec![json!({})]),
        ("levels", vec![json!({"/equipment/belt_speed_m_s": [0.35]})]),
        ("rows", vec![Value::Null]),
        ("table", vec![Value::Null]),
        ("points", vec![Value::Null]),
        ("progress", vec![Value::Null, progress(0.5)]),
        // As registered before: a repeat must not change them.
        ("backend", vec![json!("cpu")]),
        ("device", vec![json!("a test")]),
        ("api_version", vec![json!(roost_api::API_VERSION)]),
        ("solver_revision", vec![json!(roost_solver::SOLVER_REVISION)]),
        ("max_jobs", vec![json!(1)]),
        ("wait_s", vec![json!(0)]),
        ("cursor", vec![json!("1")]),
        ("count", vec![json!(1)]),
        ("bytes", vec![json!(100_000)]),
        ("offset", vec![json!(0)]),
        ("simulated_s", vec![json!(1.5)]),
        ("class", vec![json!("lost")]),
    ])
}

fn from_environment(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |text| text.parse().expect("a number"))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_answer_matches_the_specification() {
    let (server, _dir) = TestServer::with(|config| config.max_claim_wait = Duration::from_millis(5)).await;
    let spec = server.get("/openapi.json").await.expect(200.try_into().unwrap());
    let maker = ValueGenerator::new(&spec, from_environment("ROOST_SEED", 1));
    let (mut judge, mut asker) =
        (AnswerChecker::new(&spec), RequestSender { server: &server, maker, tags: HashMap::new() });
    let mut operations = operations(&spec);
    let mut seen = BTreeMap::<String, Vec<u16>>::new();
    for round in 0..from_environment("ROOST_ROUNDS", ROUNDS) {
        // Jobs get cancelled, delivered and deleted over time.
        if round % 5 == 0 {
            asker.maker.known = create_objects(&server, round).await;
        }
        asker.maker.random.shuffle(&mut operations);
        for operation in &operations {
            let (asked, answered) = asker.ask(operation).await;
            if let Some(fault) = judge.fault(&operation.about, &answered) {
                let body = String::from_utf8_lossy(&answered.body);
                panic!("{asked}\n{} {}: {fault}\n{body}", answered.status, answered.media_type);
            }
            seen.entry(format!("{} {}", operation.method, operation.path)).or_default().push(answered.status);
        }
    }
    // Some requests are valid, and some are not.
    for operation in &operations {
        let (name, needs) = (format!("{} {}", operation.method, operation.path), &operation.about);
        let statuses = &seen[&name];
        assert!(statuses.iter().any(|status| *status < 300), "{name} never succeeded: {statuses:?}");
        let may_fail = needs["parameters"].is_array() || needs["requestBody"].is_object();
        assert!(
            !may_fail || statuses.iter().any(|status| *status >= 400),
            "{name} took everything: {statuses:?}"
        );
    }
    server.stop().await;
}
