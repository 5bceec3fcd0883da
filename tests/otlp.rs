//! Traces over OTLP: a real collector, as small as they come, hears of the jobs of a real server and a real worker.

mod support;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::routing::post;
use opentelemetry_proto::tonic::collector::trace::v1::ExportTraceServiceRequest;
use opentelemetry_proto::tonic::common::v1::{KeyValue, any_value::Value};
use prost::Message;
use roost_api::job::JobState;
use support::{Home, scenario, until};

/// A span as it arrived.
#[derive(Clone, Debug)]
struct Told {
    service: String,
    name: String,
    attributes: BTreeMap<String, String>,
    events: BTreeSet<String>,
    seconds: f64,
}

impl Told {
    fn of(&self, name: &str) -> Option<&str> {
        self.attributes.get(name).map(String::as_str)
    }
}

/// Takes spans in over HTTP.
struct Collector {
    address: String,
    spans: Arc<Mutex<Vec<Told>>>,
    _runtime: tokio::runtime::Runtime,
}

impl Collector {
    fn start() -> Self {
        let spans = Arc::new(Mutex::new(Vec::new()));
        let router = Router::new().route("/v1/traces", post(taken)).with_state(spans.clone());
        let runtime = tokio::runtime::Runtime::new().unwrap();
        let listener = runtime.block_on(tokio::net::TcpListener::bind("127.0.0.1:0")).unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        runtime.spawn(async move { axum::serve(listener, router).await });
        Self { address, spans, _runtime: runtime }
    }

    fn told(&self, service: &str, is_it: impl Fn(&Told) -> bool) -> Vec<Told> {
        let spans = self.spans.lock().unwrap();
        spans.iter().filter(|span| span.service == service && is_it(span)).cloned().collect()
    }
}

async fn taken(State(spans): State<Arc<Mutex<Vec<Told>>>>, headers: HeaderMap, body: Bytes) {
    assert_eq!(headers["content-type"], "application/x-protobuf");
    for of_service in ExportTraceServiceRequest::decode(body).unwrap().resource_spans {
        let resource = texts(&of_service.resource.unwrap().attributes);
        for span in of_service.scope_spans.into_iter().flat_map(|scope| scope.spans) {
            assert!(span.trace_id.len() == 16 && span.end_time_unix_nano >= span.start_time_unix_nano);
            spans.lock().unwrap().push(Told {
                service: resource["service.name"].clone(),
                name: span.name,
                attributes: texts(&span.attributes),
                events: span
                    .events
                    .into_iter()
                    .flat_map(|event| texts(&event.attributes).into_values())
                    .collect(),
                seconds: (span.end_time_unix_nano - span.start_time_unix_nano) as f64 * 1e-9,
            });
        }
    }
}

fn texts(attributes: &[KeyValue]) -> BTreeMap<String, String> {
    let text = |value: &Value| match value {
        Value::StringValue(text) => text.clone(),
        Value::IntValue(number) => number.to_string(),
        other => format!("{other:?}"),
    };
    let value = |pair: &KeyValue| pair.value.as_ref().and_then(|value| value.value.as_ref()).map(text);
    attributes.iter().filter_map(|pair| Some((pair.key.clone(), value(pair)?))).collect()
}

#[test]
fn a_collector_hears_of_every_job_and_attempt() {
    let collector = Collector::start();
    let mut home = Home::new();
    home.set_variable("OTEL_EXPORTER_OTLP_ENDPOINT", &collector.address);
    home.set_variable("OTEL_BSP_SCHEDULE_DELAY", "200");
    let server = home.serve();
    let worker = home.work("traced");
    let job = home.submit(&scenario(0.02));
    home.job_when(&job, "a result", |job| job.state == JobState::Succeeded);
    let id = job.id.to_string();
    let of_attempt = |span: &Told| span.of("job") == Some(&id) && span.of("attempt") == Some("1");

    // While both run: what is told does not wait for their end.
    let delivered =
        until("the server tells of the delivery", || collector.told("roost-serve", of_attempt).pop());
    assert_eq!(delivered.name, "POST /v1/jobs/{id}/attempts/{n}/result");
    assert_eq!(delivered.of("http.response.status_code"), Some("200"));
    let run = until("the worker tells of the run", || {
        collector.told("roost-work", |span| span.name == "attempt" && of_attempt(span)).pop()
    });
    assert_eq!(run.of("outcome"), Some("finished"));
    let claims = collector.told("roost-serve", |span| span.name == "POST /v1/claims");
    assert!(claims.iter().any(|claim| claim.events.contains(&id)), "{claims:?}");

    // And what waits is sent when they stop.
    assert!(collector.told("roost-work", |span| span.name == "delivery" && of_attempt(span)).len() <= 1);
    worker.terminate();
    worker.wait();
    server.terminate();
    server.wait();
    let deliveries = collector.told("roost-work", |span| span.name == "delivery" && of_attempt(span));
    assert_eq!(deliveries.len(), 1);
    assert!(run.seconds > 0.0 && deliveries[0].seconds > 0.0);
    let lookups = collector.told("roost-serve", |span| span.name == "GET /v1/jobs/{id}");
    assert!(lookups.iter().any(|span| span.of("job") == Some(&id)));
}
