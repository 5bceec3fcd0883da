//! Traces over OTLP: a minimal collector receives the jobs of a real server and a real worker.
#![cfg(feature = "otlp")]

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
use support::{Sandbox, hopper_scenario, wait_until};

/// A received span.
#[derive(Clone, Debug)]
struct ReceivedSpan {
    service: String,
    name: String,
    attributes: BTreeMap<String, String>,
    events: BTreeSet<String>,
    seconds: f64,
}

impl ReceivedSpan {
    fn of(&self, name: &str) -> Option<&str> {
        self.attributes.get(name).map(String::as_str)
    }
}

/// A collector that receives spans over HTTP.
struct Collector {
    address: String,
    spans: Arc<Mutex<Vec<ReceivedSpan>>>,
    _runtime: tokio::runtime::Runtime,
}

impl Collector {
    fn start() -> Self {
        let spans = Arc::new(Mutex::new(Vec::new()));
        let router = Router::new().route("/v1/traces", post(receive)).with_state(spans.clone());
        let runtime = tokio::runtime::Runtime::new().unwrap();
        let listener = runtime.block_on(tokio::net::TcpListener::bind("127.0.0.1:0")).unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        runtime.spawn(async move { axum::serve(listener, router).await });
        Self { address, spans, _runtime: runtime }
    }

    fn wait_for_spans(&self, service: &str, matches: impl Fn(&ReceivedSpan) -> bool) -> Vec<ReceivedSpan> {
        let spans = self.spans.lock().unwrap();
        spans.iter().filter(|span| span.service == service && matches(span)).cloned().collect()
    }
}

async fn receive(State(spans): State<Arc<Mutex<Vec<ReceivedSpan>>>>, headers: HeaderMap, body: Bytes) {
    assert_eq!(headers["content-type"], "application/x-protobuf");
    for of_service in ExportTraceServiceRequest::decode(body).unwrap().resource_spans {
        let resource = texts(&of_service.resource.unwrap().attributes);
        for span in of_service.scope_spans.into_iter().flat_map(|scope| scope.spans) {
            assert!(span.trace_id.len() == 16 && span.end_time_unix_nano >= span.start_time_unix_nano);
            spans.lock().unwrap().push(ReceivedSpan {
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
fn collector_receives_every_job_and_attempt() {
    let collector = Collector::start();
    let mut sandbox = Sandbox::new();
    sandbox.set_variable("OTEL_EXPORTER_OTLP_ENDPOINT", &collector.address);
    sandbox.set_variable("OTEL_BSP_SCHEDULE_DELAY", "200");
    let server = sandbox.start_server();
    let worker = sandbox.start_worker("traced");
    let job = sandbox.submit(&hopper_scenario(0.02));
    sandbox.wait_for_job(&job, "a result", |job| job.state == JobState::Succeeded);
    let id = job.id.to_string();
    let of_attempt = |span: &ReceivedSpan| span.of("job") == Some(&id) && span.of("attempt") == Some("1");

    // While both processes run: spans are sent before the exit.
    let is_delivery =
        |span: &ReceivedSpan| span.name == "POST /v1/jobs/{id}/attempts/{n}/result" && of_attempt(span);
    let delivered = wait_until("the server tells of the delivery", || {
        collector.wait_for_spans("roost-serve", is_delivery).pop()
    });
    assert_eq!(delivered.of("http.response.status_code"), Some("200"));
    let run = wait_until("the worker tells of the run", || {
        collector.wait_for_spans("roost-work", |span| span.name == "attempt" && of_attempt(span)).pop()
    });
    assert_eq!(run.of("outcome"), Some("finished"));
    let claims = collector.wait_for_spans("roost-serve", |span| span.name == "POST /v1/claims");
    assert!(claims.iter().any(|claim| claim.events.contains(&id)), "{claims:?}");

    // The exit sends the remaining spans.
    assert!(
        collector.wait_for_spans("roost-work", |span| span.name == "delivery" && of_attempt(span)).len() <= 1
    );
    worker.terminate();
    worker.wait();
    server.terminate();
    server.wait();
    let deliveries =
        collector.wait_for_spans("roost-work", |span| span.name == "delivery" && of_attempt(span));
    assert_eq!(deliveries.len(), 1);
    assert!(run.seconds > 0.0 && deliveries[0].seconds > 0.0);
    let lookups = collector.wait_for_spans("roost-serve", |span| span.name == "GET /v1/jobs/{id}");
    assert!(lookups.iter().any(|span| span.of("job") == Some(&id)));
}
