//! The audit log of a real server: changes and refusals with their token.

mod support;

use std::process::Command;

use serde_json::{Value, json};

use support::{Process, Sandbox, hopper_scenario, run, stdout, wait_until};

/// Fields of a response.
struct Answered {
    status: u16,
    request: String,
    location: Option<String>,
}

fn ask(sandbox: &Sandbox, method: &str, path: &str, token: &str, body: Option<&Value>) -> Answered {
    let mut curl = Command::new("curl");
    curl.args([
        "-s",
        "-o",
        "/dev/null",
        "-D",
        "-",
        "-X",
        method,
        "-H",
        &format!("authorization: Bearer {token}"),
    ]);
    if let Some(body) = body {
        curl.args(["-H", "content-type: application/json", "--data", &body.to_string()]);
    }
    let head = stdout(&curl.arg(format!("{}{path}", sandbox.address)).output().unwrap());
    let header = |name: &str| {
        let values = head.lines().filter_map(|line| line.split_once(": "));
        values
            .filter(|(known, _)| known.eq_ignore_ascii_case(name))
            .map(|(_, value)| value.trim().to_owned())
            .next()
    };
    Answered {
        status: head.split_whitespace().nth(1).unwrap().parse().unwrap(),
        request: header("x-request-id").expect("every answer has one"),
        location: header("location"),
    }
}

/// The audit log so far: lines that are JSON objects.
fn lines(server: &Process) -> Vec<Value> {
    let log = server.log();
    let lines = log.lines().filter(|line| line.starts_with('{'));
    let lines = lines
        .map(|line| serde_json::from_str::<Value>(line).unwrap_or_else(|error| panic!("{error}: {line}")));
    lines.filter(|line| line["target"] == "audit").collect()
}

#[test]
fn every_change_and_refusal_is_one_log_line() {
    let sandbox = Sandbox::new();
    let data = sandbox.path("data").display().to_string();
    let create = |scope: &str, name: &str| {
        let made = run(&["token", "create", "--json", "--scope", scope, "--name", name, "--data", &data]);
        let made: Value = serde_json::from_str(&stdout(&made)).unwrap();
        (made["token"].as_str().unwrap().to_owned(), made["view"]["id"].as_str().unwrap().to_owned())
    };
    stdout(&run(&["project", "create", "wax", "--data", &data]));
    let user = ["--user", "Ada Lovelace", "--project", "wax"];
    let made =
        run(&[&["token", "create", "--json", "--scope", "admin", "--data", &data][..], &user].concat());
    let made: Value = serde_json::from_str(&stdout(&made)).unwrap();
    let (admin, admin_id) = (made["token"].as_str().unwrap(), &made["view"]["id"]);
    let server = sandbox.spawn_server(&["--lease-s", "2", "--log-format", "json"]);
    wait_until("the server answers", || sandbox.status("/healthz").filter(|status| *status == 200));

    let sweep = json!({"name": "audited", "base": hopper_scenario(0.1), "design": {"kind": "grid"}});
    let worker = json!({"worker_id": "01890000-0000-7000-8000-00000000000a", "name": "w", "api_version": "1", "backend": "cpu",
        "solver_revision": 1, "device": "none", "threads": 1});
    let study = json!({"schema": "roost.study/1", "name": "audited", "base": hopper_scenario(0.1),
        "factors": [{"pointer": "/equipment/gate_opening_m", "low": 0.05, "high": 0.06}],
        "goal": {"boundary": {"of": {"probability": "jammed"}, "level": 0.05}}, "budget": {"max_runs": 1500}});
    let mut expected = Vec::new();
    let mut act = |action: &'static str, method: &str, path: &str, body: Option<&Value>| {
        let answered = ask(&sandbox, method, path, admin, body);
        expected.push((
            action,
            answered.request.clone(),
            path.to_owned(),
            answered.status,
            answered.location.clone(),
        ));
        answered
    };
    let job =
        act("submit", "POST", "/v1/jobs", Some(&json!({"scenario": hopper_scenario(0.1)}))).location.unwrap();
    let sweep = act("submit", "POST", "/v1/sweeps", Some(&sweep)).location.unwrap();
    act("submit", "POST", "/v1/sweeps", Some(&json!({"name": 5})));
    act("submit", "POST", &format!("{sweep}/extend"), Some(&json!({"replicates": 1})));
    act("cancel", "POST", &format!("{job}/cancel"), None);
    act("retry", "POST", &format!("{job}/retry"), None);
    act("cancel", "POST", &format!("{sweep}/cancel"), None);
    act("retry", "POST", &format!("{sweep}/retry"), None);
    act("delete", "DELETE", &sweep, None);
    act("cancel", "POST", &format!("{sweep}/cancel"), None);
    act("delete", "DELETE", &sweep, None);
    act("prune", "POST", "/v1/prune?older_than_s=1e9", None);
    let study = act("submit", "POST", "/v1/studies", Some(&study)).location.unwrap();
    act("pause", "POST", &format!("{study}/pause"), None);
    act("resume", "POST", &format!("{study}/resume"), None);
    act("change", "POST", &format!("{study}/budget"), Some(&json!({"max_runs": 2000})));
    let wider = json!([{"pointer": "/equipment/gate_opening_m", "low": 0.04, "high": 0.06}]);
    act("change", "POST", &format!("{study}/ranges"), Some(&json!({"ranges": wider})));
    act("ask", "POST", &format!("{study}/ask"), Some(&json!({"count": 0})));
    act("tell", "POST", &format!("{study}/tell"), Some(&json!({"outcomes": []})));
    act("cancel", "POST", &format!("{study}/cancel"), None);
    act("drain", "POST", "/v1/workers/01890000-0000-7000-8000-00000000000b/drain", None);
    // An unknown query parameter does not suppress the line.
    act("submit", "POST", "/v1/jobs?dry_run=true", Some(&json!({"scenario": hopper_scenario(0.2)})));
    act("cancel", "POST", &format!("{job}/cancel?dry_run=true"), None);
    let statuses: Vec<_> = expected.iter().map(|row| row.3).collect();
    assert_eq!(
        statuses,
        [
            202, 201, 422, 200, 200, 200, 200, 200, 409, 200, 200, 200, 201, 200, 200, 200, 200, 422, 200,
            200, 404, 202, 200
        ],
        "{expected:?}"
    );
    // None of these requests changes data of users.
    ask(&sandbox, "GET", "/v1/jobs", admin, None);
    ask(&sandbox, "POST", "/v1/prune?older_than_s=1e9&dry_run=true", admin, None);
    ask(&sandbox, "POST", "/v1/workers", admin, Some(&worker));

    let guessed = ask(&sandbox, "GET", "/v1/jobs", "guessed", None);
    assert_eq!(guessed.status, 401);
    let (reader, reader_id) = create("read", "reader\n\u{1b}[31m");
    wait_until("the token is known", || {
        (ask(&sandbox, "GET", "/v1/jobs", &reader, None).status == 200).then_some(())
    });
    let forbidden = ask(&sandbox, "POST", "/v1/prune?older_than_s=0", &reader, None);
    assert_eq!(forbidden.status, 403);
    let signed_in = ask(&sandbox, "POST", "/dashboard/session", "guessed", None);
    assert_eq!(signed_in.status, 401);
    stdout(&run(&["token", "revoke", "--data", &data, &reader_id]));
    wait_until("the token is gone", || {
        (ask(&sandbox, "GET", "/v1/jobs", &reader, None).status == 401).then_some(())
    });

    let log = lines(&server);
    let done: Vec<_> =
        log.iter().filter(|line| line["action"] != "refuse" && !line["path"].is_null()).collect();
    assert_eq!(done.len(), expected.len(), "one line each, and no others: {done:#?}");
    for (line, (action, request, path, status, location)) in done.iter().zip(&expected) {
        assert_eq!(line["action"], *action, "{line}");
        assert_eq!(line["token"], *admin_id, "{line}");
        assert_eq!((&line["user"], &line["project"]), (&json!("Ada Lovelace"), &json!("wax")), "{line}");
        assert_eq!(line["request"], *request, "{line}");
        assert_eq!(line["path"].as_str(), path.split('?').next(), "{line}");
        assert_eq!(line["status"], *status, "{line}");
        assert_eq!(line["made"].as_str(), location.as_deref(), "{line}");
        assert!(line["peer"].as_str().unwrap().starts_with("127.0.0.1:"), "{line}");
        assert!(line["timestamp"].is_string() && line["level"] == "INFO", "{line}");
    }
    let refused = |request: &str| log.iter().filter(|line| line["request"] == request).collect::<Vec<_>>();
    for (answered, token, path, reason) in [
        (&guessed, json!(null), "/v1/jobs", "A valid token is required"),
        (&signed_in, json!(null), "/dashboard/session", "A valid token is required"),
        (&forbidden, json!(reader_id), "/v1/prune", "The token does not allow this"),
    ] {
        let lines = refused(&answered.request);
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert_eq!((&lines[0]["action"], &lines[0]["level"]), (&json!("refuse"), &json!("WARN")));
        assert_eq!((&lines[0]["status"], &lines[0]["reason"]), (&json!(answered.status), &json!(reason)));
        assert_eq!((&lines[0]["token"], &lines[0]["path"]), (&token, &json!(path)));
        let project = if token.is_null() { json!(null) } else { json!("default") };
        assert_eq!(lines[0]["project"], project);
    }
    for action in ["token_create", "token_revoke"] {
        let lines: Vec<_> = log.iter().filter(|line| line["action"] == action).collect();
        assert_eq!(lines.len(), 1, "{action}: {lines:?}");
        assert_eq!((&lines[0]["token"], &lines[0]["scopes"]), (&json!(reader_id), &json!("read")));
        // Without `--user`, the name of the token names the user.
        assert_eq!((&lines[0]["user"], &lines[0]["project"]), (&lines[0]["name"], &json!("default")));
    }
    let log = server.log();
    assert!(!log.contains(admin) && !log.contains(&reader), "no secret is logged");
}

#[test]
fn changes_of_projects_are_logged_with_their_old_values() {
    let sandbox = Sandbox::new();
    let data = sandbox.path("data").display().to_string();
    stdout(&run(&["project", "create", "wax", "--data", &data]));
    let server = sandbox.spawn_server(&["--log-format", "json"]);
    wait_until("the server answers", || sandbox.status("/healthz").filter(|status| *status == 200));
    let mut expected = Vec::new();
    for (change, fields) in [
        (&["create", "ink", "--share", "2"][..], json!(["project_create", "ink", 2, "none", null, null])),
        (&["set", "ink", "--budget-core-hours", "7.5"], json!(["project_set", "ink", 2, "7.5", 2, "none"])),
        (&["set", "wax", "--share", "3"], json!(["project_set", "wax", 3, "none", 1, "none"])),
        (&["set", "ink", "--budget-core-hours", "none"], json!(["project_set", "ink", 2, "none", 2, "7.5"])),
    ] {
        stdout(&run(&[&["project"], change, &["--data", &data]].concat()));
        expected.push(fields);
        let of = |line: &Value| {
            let names = [
                "action",
                "project",
                "share",
                "budget_core_hours",
                "share_before",
                "budget_core_hours_before",
            ];
            json!(names.map(|name| &line[name]))
        };
        let logged = || lines(&server).iter().map(of).collect::<Vec<_>>();
        wait_until("the server notices the change", || {
            Some(logged()).filter(|it| it.len() >= expected.len())
        });
        assert_eq!(logged(), expected);
    }
}

#[test]
fn client_that_disconnects_before_the_response_is_logged() {
    let sandbox = Sandbox::new();
    let server = sandbox.spawn_server(&["--log-format", "json"]);
    wait_until("the server answers", || sandbox.status("/healthz").filter(|status| *status == 200));
    let sweep = json!({"name": "left", "base": hopper_scenario(0.1), "design": {"kind": "grid"}, "replicates": 50_000});
    let file = sandbox.file("sweep.json", &sweep);
    let mut curl = Command::new("curl");
    curl.args([
        "-s",
        "--max-time",
        "0.2",
        "-H",
        "content-type: application/json",
        "--data",
        &format!("@{file}"),
    ]);
    // Proxies append to this header.
    curl.args(["-H", &format!("x-forwarded-for: {}, 192.0.2.7", "9".repeat(300))]);
    curl.arg(format!("{}/v1/sweeps", sandbox.address));
    let mut left = 0;
    let line = wait_until("a line is written", || {
        // Again, if the server had not begun with the request on a busy machine.
        left += u32::from(!curl.output().unwrap().status.success());
        std::thread::sleep(std::time::Duration::from_millis(500));
        lines(&server).into_iter().find(|line| line["action"] == "submit" && line["path"] == "/v1/sweeps")
    });
    // A fast machine may respond in time, or just after it.
    assert!(
        line["message"] == "done" || (line["message"] == "unanswered" && left > 0),
        "{left} left: {line}"
    );
    assert_eq!(
        (&line["token"], &line["project"], &line["user"]),
        (&json!("open"), &json!("default"), &json!(null))
    );
    let forwarded_for = line["forwarded_for"].as_str().unwrap();
    assert!(forwarded_for.ends_with(", 192.0.2.7") && forwarded_for.len() <= 200, "{line}");
    wait_until("the sweep is there all the same", || {
        (!sandbox.get("/v1/sweeps")["items"].as_array()?.is_empty()).then_some(())
    });
}

#[test]
fn flood_of_refusals_does_not_fill_the_disk() {
    let sandbox = Sandbox::new();
    let data = sandbox.path("data").display().to_string();
    stdout(&run(&["token", "create", "--scope", "admin", "--data", &data]));
    let server = sandbox.spawn_server(&["--log-format", "json"]);
    wait_until("the server answers", || sandbox.status("/healthz").filter(|status| *status == 200));
    // One process, so that the requests are simultaneous.
    let urls = format!("{}/v1/jobs?n=[1-2000]", sandbox.address);
    let flood =
        Command::new("curl").args(["-s", "-o", "/dev/null", "-w", "%{http_code}\n", &urls]).output().unwrap();
    let statuses = stdout(&flood);
    assert_eq!(statuses.lines().filter(|status| *status == "401").count(), 2000, "{statuses}");
    std::thread::sleep(std::time::Duration::from_millis(1100));
    ask(&sandbox, "GET", "/v1/jobs", "guessed", None);
    let log = lines(&server);
    let refused = log.iter().filter(|line| line["action"] == "refuse").count() as u64;
    let left_out: u64 = log.iter().filter_map(|line| line["left_out"].as_u64()).sum();
    assert!(refused < 1000, "{refused} lines");
    assert_eq!(refused + left_out, 2001, "none is forgotten");
}

#[test]
fn text_log_has_the_same_lines() {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    sandbox.submit(&hopper_scenario(0.1));
    let log = server.log();
    let line = log.lines().find(|line| line.contains("audit")).unwrap_or_else(|| panic!("no line: {log}"));
    for part in ["INFO audit: ", "action=\"submit\"", "token=\"open\"", "status=202", "path=\"/v1/jobs\""] {
        assert!(line.contains(part), "{part}: {line}");
    }
}
