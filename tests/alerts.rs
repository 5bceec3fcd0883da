//! The alert rules of `deploy/alerts.yaml`: `promtool` tests each rule, all metrics exist, and one rule fires in a real Prometheus.
//! The expressions of `deploy/grafana-dashboard.json` are valid, and their metrics exist as well.

#[path = "../server/src/store/testing/cluster.rs"]
#[allow(dead_code, reason = "no test here recovers PostgreSQL")]
mod cluster;
mod support;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use cluster::Cluster;
use roost_api::job::JobState;
use serde_json::{Value, json};
use support::{Sandbox, transcript, wait_until};

fn rules() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy/alerts.yaml")
}

fn tests() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/alerts/alerts.test.yaml")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// The names of all alerts.
fn alerts() -> Vec<String> {
    let names: Vec<_> =
        read(&rules()).lines().filter_map(|line| Some(line.split_once("- alert: ")?.1.to_owned())).collect();
    assert!(names.len() >= 10, "{names:?}");
    names
}

fn promtool(arguments: &[&str]) -> std::process::Output {
    Command::new("promtool").args(arguments).output().expect("promtool is there: `make needs` installs it")
}

#[test]
fn every_alert_fires_and_stays_silent() {
    let (rules, tests) = (rules().display().to_string(), tests().display().to_string());
    for arguments in [["check", "rules", &rules], ["test", "rules", &tests]] {
        let output = promtool(&arguments);
        assert!(output.status.success(), "{}", transcript(&output));
    }
    let text = read(Path::new(&tests));
    let cases: Vec<_> = text.split("\n  - name: ").skip(1).collect();
    for alert in alerts() {
        let case = |is: &str| {
            let case = cases.iter().find(|case| case.starts_with(&format!("{alert} {is}\n")));
            let case = case.unwrap_or_else(|| panic!("no case in which {alert} {is}"));
            assert!(case.contains(&format!("ALERTS{{alertname=\"{alert}\"")), "{case}");
            !case.contains("exp_samples: []")
        };
        assert!(case("fires") && !case("stays silent"), "{alert}");
    }
}

#[test]
fn every_alert_is_in_the_documentation() {
    let page = read(&rules().with_file_name("../docs/howto/operate.md"));
    for alert in alerts() {
        assert!(page.contains(&format!("| `{alert}` |")), "{alert}");
    }
}

/// The dashboard for Grafana.
fn dashboard() -> Value {
    serde_json::from_str(&read(&rules().with_file_name("grafana-dashboard.json"))).unwrap()
}

/// The expressions in a part of the dashboard: of panels, annotations and variables.
fn expressions(part: &Value) -> Vec<String> {
    let of_field = |(key, value): (&String, &Value)| match value {
        Value::String(text) if ["expr", "definition"].contains(&key.as_str()) => vec![text.clone()],
        _ => expressions(value),
    };
    match part {
        Value::Object(fields) => fields.iter().flat_map(of_field).collect(),
        Value::Array(parts) => parts.iter().flat_map(expressions).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn dashboard_has_valid_expressions_and_names_existing_alerts() {
    let dashboard = dashboard();
    let of_panels = expressions(&dashboard["panels"]).into_iter().enumerate();
    let rules: Vec<Value> = of_panels
        .map(|(number, text)| {
            let text = text.replace("$__rate_interval", "5m");
            json!({"record": format!("dashboard:{number}"), "expr": text})
        })
        .collect();
    assert!(rules.len() > 25, "{rules:?}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rules.yaml");
    let groups = json!({"groups": [{"name": "dashboard", "rules": rules}]});
    std::fs::write(&path, groups.to_string()).unwrap();
    let output = promtool(&["check", "rules", &path.display().to_string()]);
    assert!(output.status.success(), "{}", transcript(&output));

    let text = dashboard.to_string();
    let words = text.split(|c: char| !c.is_ascii_alphanumeric());
    let named: BTreeSet<&str> = words.filter(|word| word.len() > 5 && word.starts_with("Roost")).collect();
    assert!(named.len() > 5, "{named:?}");
    let alerts = alerts();
    for name in named {
        assert!(alerts.iter().any(|alert| alert == name), "{name}");
    }
}

/// Metrics in expressions with their label selectors: `(metric, Some((label, values)))`.
fn metrics_in(text: &str) -> BTreeSet<(String, Option<(String, String)>)> {
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut named = BTreeSet::new();
    let starts = ["roost_", "process_"].iter().flat_map(|prefix| text.match_indices(prefix));
    for (start, _) in starts.filter(|(start, _)| !text[..*start].ends_with(is_name)) {
        let rest = &text[start..];
        let (name, rest) = rest.split_at(rest.find(|c| !is_name(c)).unwrap());
        named.insert((name.to_owned(), None));
        // A value may contain braces.
        let Some((selector, _)) = rest.strip_prefix('{').and_then(|rest| rest.split_once("\"}")) else {
            continue;
        };
        for matcher in selector.split(", ") {
            let (label, value) = matcher.split_once('=').unwrap();
            let value = value.trim_matches(['~', '"']);
            named.insert((name.to_owned(), Some((label.to_owned(), value.to_owned()))));
        }
    }
    named
}

#[test]
fn rules_and_dashboard_use_only_metrics_and_labels_of_a_real_server() {
    let text = metrics_after_work();
    let samples: Vec<_> = text.lines().filter(|line| !line.starts_with('#')).collect();
    let in_rules = metrics_in(&read(&rules()));
    let in_dashboard = metrics_in(&format!("{}\n", expressions(&dashboard()).join("\n")));
    assert!(in_rules.len() > 15 && in_dashboard.len() > 40, "{in_rules:?} {in_dashboard:?}");
    for (metric, label) in in_rules.into_iter().chain(in_dashboard) {
        let of_metric = samples.iter().filter(|line| {
            line.strip_prefix(metric.as_str()).is_some_and(|rest| rest.starts_with(['{', ' ']))
        });
        let of_metric: Vec<_> = of_metric.collect();
        assert!(!of_metric.is_empty(), "no {metric}:\n{text}");
        // Prometheus adds `job` and `instance`, and a server without errors has no status of errors.
        let is_own = |label: &str| !["job", "instance"].contains(&label);
        let Some((label, values)) = label.filter(|(label, _)| is_own(label)) else { continue };
        let is_error = ["4..", "5.."].contains(&values.as_str());
        let any: Vec<&str> = if is_error {
            vec![""]
        } else {
            values.split('|').map(|value| value.trim_end_matches('.')).collect()
        };
        for value in any {
            let wanted = format!("{label}=\"{value}");
            assert!(
                of_metric.iter().any(|line| line.contains(&wanted)),
                "no {metric} with {wanted}:\n{text}"
            );
        }
    }
}

/// The metrics of a server that has done some work.
fn metrics_after_work() -> String {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let job = sandbox.submit(&support::hopper_scenario(0.2));
    let _worker = sandbox.start_worker("worker");
    sandbox.wait_for_job(&job, "the job has succeeded", |job| job.state == JobState::Succeeded);
    let url = format!("{}/metrics", sandbox.address);
    let client = reqwest::Client::builder().no_proxy().build().unwrap();
    // The server counts the request of the delivery after the job has its state.
    wait_until("the delivery is counted", || {
        let request = client.get(&url).send();
        let text = sandbox.ask(|_| async move { request.await.unwrap().text().await }).unwrap();
        let is_delivery =
            |line: &str| line.starts_with("roost_http_requests_total{") && line.contains("/result\"");
        text.lines().any(is_delivery).then_some(text)
    })
}

#[test]
fn table_of_metrics_is_complete() {
    let api = read(&rules().with_file_name("../api.md"));
    let listed: BTreeSet<_> =
        api.lines().filter_map(|line| line.strip_prefix("| `")?.split(['`', '{']).next()).collect();
    let text = metrics_after_work();
    let there: BTreeSet<_> = text
        .lines()
        .filter_map(|line| line.strip_prefix("# TYPE ")?.split_once(' '))
        .map(|(name, kind)| match kind {
            "counter" => format!("{name}_total"),
            "info" => format!("{name}_info"),
            _ => name.to_owned(),
        })
        .collect();
    assert!(there.len() > 15, "{text}");
    for name in &there {
        assert!(listed.contains(name.as_str()), "{name} is not in api.md");
    }
    for name in listed.iter().filter(|name| name.starts_with("roost_") || name.starts_with("process_")) {
        assert!(there.contains(*name), "{name} is only in api.md");
    }
}

/// A process that ends with the test.
struct Prometheus(std::process::Child);

impl Drop for Prometheus {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Prometheus {
    /// Starts one that reads the metrics of servers every second, and whose alerts wait for nothing. `here` has its files and its address.
    fn start(here: &Sandbox, servers: &[&Sandbox]) -> Self {
        let text = read(&rules());
        let quick = text.lines().map(|line| match line.trim_start().starts_with("for: ") {
            true => "        for: 0s\n".to_owned(),
            false => format!("{line}\n"),
        });
        std::fs::write(here.path("alerts.yaml"), quick.collect::<String>()).unwrap();
        let targets: Vec<_> =
            servers.iter().map(|server| server.address.trim_start_matches("http://")).collect();
        let config = format!(
            "global: {{scrape_interval: 1s, evaluation_interval: 1s}}\n\
             rule_files: [alerts.yaml]\n\
             scrape_configs: [{{job_name: roost, static_configs: [{{targets: {targets:?}}}]}}]\n"
        );
        std::fs::write(here.path("prometheus.yml"), config).unwrap();
        let listen = here.address.trim_start_matches("http://");
        let log = std::fs::File::create(here.path("prometheus.log")).unwrap();
        let child = Command::new("prometheus")
            .arg(format!("--config.file={}", here.path("prometheus.yml").display()))
            .arg(format!("--storage.tsdb.path={}", here.path("series").display()))
            .arg(format!("--web.listen-address={listen}"))
            .stdin(Stdio::null())
            .stdout(log.try_clone().unwrap())
            .stderr(log)
            .spawn()
            .expect("prometheus is there: `make needs` installs it");
        Self(child)
    }
}

/// The answer of the API of a Prometheus; none until it runs.
fn ask_prometheus(here: &Sandbox, path: &str) -> Option<Value> {
    let client = reqwest::Client::builder().no_proxy().build().unwrap();
    let request = client.get(format!("{}/api/v1/{path}", here.address)).send();
    here.ask(|_| async move { request.await.ok()?.json().await.ok() })
}

/// The alert of a name that fires.
fn firing(here: &Sandbox, alert: &str) -> Option<Value> {
    let answer = ask_prometheus(here, "alerts")?;
    let alerts = answer["data"]["alerts"].as_array()?;
    let named = |fired: &&Value| fired["labels"]["alertname"] == *alert && fired["state"] == "firing";
    alerts.iter().find(named).cloned()
}

#[test]
fn alert_of_a_real_server_fires_in_prometheus() {
    let (sandbox, other) = (Sandbox::new(), Sandbox::new());
    let server = sandbox.start_server();
    sandbox.submit(&support::hopper_scenario(1.0));
    let _prometheus = Prometheus::start(&other, &[&sandbox]);
    let fired = wait_until("the alert on jobs without a worker", || firing(&other, "RoostNoWorkers"));
    assert_eq!(fired["annotations"]["summary"], "1 jobs are queued, and no worker is connected");
    // Prometheus takes a scrape that is answered after a second for one that failed.
    wait_until("no alert on the server", || {
        (ask_prometheus(&other, "alerts").is_some() && firing(&other, "RoostDown").is_none()).then_some(())
    });
    server.terminate();
    server.wait();
    wait_until("the alert on the end of the server", || firing(&other, "RoostDown"));
    let rules = ask_prometheus(&other, "rules").unwrap();
    let rules = rules["data"]["groups"][0]["rules"].as_array().unwrap();
    assert_eq!(rules.len(), alerts().len());
    for rule in rules {
        assert_eq!(rule["health"], "ok", "{rule}");
    }
}

#[test]
fn lost_postgresql_fires_an_alert() {
    let postgres = Cluster::start(&std::env::temp_dir(), "");
    let database = postgres.create("roost");
    let (one, two, other) = (Sandbox::new(), Sandbox::new(), Sandbox::new());
    // Both have one folder of objects.
    std::fs::create_dir(one.path("data")).unwrap();
    std::os::unix::fs::symlink(one.path("data"), two.path("data")).unwrap();
    let start = |sandbox: &Sandbox| sandbox.start_server_with(&["--database", &database]);
    let (_first, second) = (start(&one), start(&two));
    wait_until("it stands by", || second.log().contains("requests are passed on").then_some(()));
    let _prometheus = Prometheus::start(&other, &[&one, &two]);
    let leaders = || {
        ask_prometheus(&other, "query?query=sum(roost_leader)%2Bcount(roost_leader)")?["data"]["result"]
            .get(0)
            .cloned()
    };
    wait_until("both are read, and one leads", || leaders().filter(|sum| sum["value"][1] == "3"));
    let none = |alerts: &[&str]| alerts.iter().all(|alert| firing(&other, alert).is_none());
    wait_until("no alert on the servers", || {
        none(&["RoostNoLeader", "RoostSeveralLeaders", "RoostDown"]).then_some(())
    });
    drop(postgres);
    wait_until("the alert that no server leads", || firing(&other, "RoostNoLeader"));
    let former = one.address.trim_start_matches("http://");
    wait_until("the alert on the former leader", || {
        firing(&other, "RoostDown").filter(|down| down["labels"]["instance"] == *former)
    });
}
