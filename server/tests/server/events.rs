//! Event streams: events, resumption, end.

use std::time::Duration;

use reqwest::{Response, StatusCode};
use serde_json::{Value, json};

use super::test_server::*;

pub(crate) struct Event {
    pub name: String,
    id: Option<i64>,
    pub data: Value,
}

/// An event stream as a client reads it.
pub(crate) struct Events {
    response: Response,
    text: String,
}

impl Events {
    pub(crate) async fn open(server: &TestServer, path: &str, last: Option<i64>) -> Self {
        let mut request = server.http.get(format!("http://{}{path}/events", server.address));
        if let Some(last) = last {
            request = request.header("last-event-id", last);
        }
        let response = request.send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK);
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        Self { response, text: String::new() }
    }

    /// The next event; none when the stream has ended.
    pub(crate) async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some((event, rest)) = self.text.split_once("\n\n") {
                let field = |name: &str| {
                    event
                        .lines()
                        .find_map(|line| line.strip_prefix(name))
                        .map(|value| value.trim().to_owned())
                };
                let found = field("data:").map(|data| Event {
                    name: field("event:").unwrap(),
                    id: field("id:").map(|id| id.parse().unwrap()),
                    data: serde_json::from_str(&data).unwrap(),
                });
                self.text = rest.to_owned();
                if found.is_some() {
                    return found;
                }
                continue;
            }
            let chunk =
                tokio::time::timeout(Duration::from_secs(20), self.response.chunk()).await.expect("in time");
            self.text += str::from_utf8(&chunk.ok()??).unwrap();
        }
    }

    /// The next `change` event; `progress` events are skipped.
    async fn change(&mut self) -> Event {
        loop {
            let event = self.next().await.expect("a change");
            if event.name == "change" {
                return event;
            }
        }
    }
}

#[tokio::test]
async fn stream_starts_with_the_current_view_and_resumes_after_any_event() {
    let (server, _dir) = TestServer::start().await;
    let spec =
        json!({"name": "a", "base": scenario(1), "design": {"kind": "grid"}, "factors": [], "replicates": 2});
    let sweep = server.post("/v1/sweeps", &spec).await.expect(StatusCode::CREATED);
    let path = format!("/v1/sweeps/{}", text(&sweep["id"]));
    let mut events = Events::open(&server, &path, None).await;
    let now = events.next().await.unwrap();
    assert_eq!((now.name.as_str(), &now.data["counts"]["queued"]), ("sweep", &json!(2)));

    let worker = server.worker("cpu").await;
    let attempt = worker.claim_one().await;
    let claimed = events.change().await;
    assert_eq!((&claimed.data["job_id"], &claimed.data["state"]), (&attempt["job_id"], &json!("running")));
    worker.beat(&attempt, progress(0.5)).await;
    let shown = events.next().await.unwrap();
    assert_eq!((shown.name.as_str(), shown.id), ("progress", None));
    drop(events);

    // These events happen without a client; those of another sweep do not belong to this one.
    worker.deliver(&attempt).await.expect(StatusCode::OK);
    let elsewhere = server.submit(&envelope(77)).await;
    let other = worker.claim(2).await;
    let mut events = Events::open(&server, &path, claimed.id).await;
    let (first, second) = (events.change().await, events.change().await);
    assert_eq!((&first.data["state"], &second.data["state"]), (&json!("succeeded"), &json!("running")));
    assert!(other.len() == 2 && second.data["job_id"] != elsewhere["id"], "{}", second.data);
    let mut again = Events::open(&server, &path, first.id).await;
    let repeated = again.change().await;
    assert_eq!((repeated.id, repeated.data), (second.id, second.data));

    // The connection may have broken before the view that follows the newest event.
    for path in [path.as_str(), &format!("/v1/jobs/{}", text(&attempt["job_id"]))] {
        let mut resumed = Events::open(&server, path, second.id).await;
        let now = resumed.next().await.unwrap();
        assert_eq!(
            (now.name.as_str(), now.id, &now.data["id"]),
            ("progress", None, &json!(path[path.len() - 36..]))
        );
        // A shared view that is not the newest is followed by the newest; nothing repeats for ever.
        let mut views = 1;
        while let Ok(event) = tokio::time::timeout(Duration::from_secs(1), resumed.next()).await {
            views += usize::from(event.unwrap().name == "progress");
            assert!(views <= 2, "the view repeats");
        }
    }

    // A stream that cannot be resumed starts anew.
    let mut unknown = Events::open(&server, &path, Some(1_000_000)).await;
    assert_eq!(unknown.next().await.unwrap().name, "sweep");
    let job = format!("/v1/jobs/{}", text(&attempt["job_id"]));
    let mut of_job = Events::open(&server, &job, None).await;
    let now = of_job.next().await.unwrap();
    assert_eq!((now.name.as_str(), &now.data["state"]), ("job", &json!("succeeded")));
    drop((events, again, unknown, of_job));
    server.get("/v1/jobs/01890000-0000-7000-8000-000000000000/events").await.problem(404, "not-found");
    server.stop().await;
}

#[tokio::test]
async fn open_streams_end_with_the_server() {
    let (server, _dir) = TestServer::start().await;
    let job = server.submit(&envelope(1)).await;
    let path = format!("/v1/jobs/{}", text(&job["id"]));
    let mut streams = Vec::new();
    for _ in 0..20 {
        let mut events = Events::open(&server, &path, None).await;
        events.next().await.expect("the job as it is");
        streams.push(events);
    }
    let took = server.stop().await;
    assert!(took < Duration::from_secs(2), "{took:?}");
    for mut events in streams {
        assert!(events.next().await.is_none(), "the end");
    }
}

#[tokio::test]
async fn stream_of_a_sweep_reports_extension_and_ends_with_deletion() {
    let (server, _dir) = TestServer::start().await;
    let sweep = json!({"name": "one", "base": scenario(1), "design": {"kind": "grid"},
                       "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045]}]});
    let view = server.post("/v1/sweeps", &sweep).await.expect(StatusCode::CREATED);
    let path = format!("/v1/sweeps/{}", text(&view["id"]));
    let mut events = Events::open(&server, &path, None).await;
    assert_eq!(events.next().await.unwrap().name, "sweep");
    server.post(&format!("{path}/extend"), &json!({"replicates": 2})).await.expect(StatusCode::OK);
    let grown = loop {
        let event = events.next().await.expect("the stream goes on");
        if event.name == "extended" {
            break event;
        }
    };
    assert_eq!((&grown.data["replicates"], &grown.data["counts"]["queued"]), (&json!(3), &json!(3)));
    server.post(&format!("{path}/cancel"), &json!({})).await.expect(StatusCode::OK);
    server.send(reqwest::Method::DELETE, &path, None).await.expect(StatusCode::OK);
    let mut last = None;
    while let Some(event) = events.next().await {
        last = Some(event);
    }
    let last = last.expect("events arrived");
    assert_eq!((last.name.as_str(), &last.data["id"]), ("deleted", &view["id"]));
    server.stop().await;
}

#[tokio::test]
async fn all_followers_of_a_sweep_get_its_last_progress() {
    let (server, _dir) = TestServer::start().await;
    let spec = json!({"name": "a", "base": scenario(1), "design": {"kind": "grid"}, "factors": [], "replicates": 12});
    let sweep = server.post("/v1/sweeps", &spec).await.expect(StatusCode::CREATED);
    let path = format!("/v1/sweeps/{}", text(&sweep["id"]));
    let mut streams = Vec::new();
    for _ in 0..4 {
        streams.push(Events::open(&server, &path, None).await);
        tokio::time::sleep(Duration::from_millis(40)).await;
    }
    let worker = server.worker("cpu").await;
    for attempt in worker.claim(12).await {
        worker.deliver(&attempt).await.expect(StatusCode::OK);
        tokio::time::sleep(Duration::from_millis(30)).await;
    }
    for events in &mut streams {
        // An outdated progress event is followed by the newest one.
        let told = async {
            loop {
                let event = events.next().await.expect("more to come");
                if event.name == "progress" && event.data["counts"]["succeeded"] == 12 {
                    break;
                }
            }
        };
        tokio::time::timeout(Duration::from_secs(10), told).await.expect("in time");
    }
    assert_eq!(server.get(&path).await.body["counts"]["succeeded"], 12);
    server.stop().await;
}
