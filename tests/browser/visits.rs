//! Hidden pages, Swagger UI, and viewers with a wrong clock.

use std::time::Duration;

use serde_json::json;

use super::page::Page;
use super::support::{Sandbox, hopper_scenario};
use super::text;

#[test]
fn a_hidden_page_stops_following_its_sweep() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    let file = sandbox.file(
        "sweep.json",
        &json!({"name": "waits", "base": hopper_scenario(0.2), "design": {"kind": "grid"}, "replicates": 2}),
    );
    let sweep = sandbox.json_output(&["submit", &file]);
    let id = text(&sweep["id"]);
    page.open(&format!("/sweeps/{id}"));
    let shows = |replicates: u64| {
        format!("document.querySelector('.facts').textContent.includes('1 point × {replicates}')")
    };
    page.until("the page is there", &shows(2));
    let grow = |page: &mut Page| {
        assert!(sandbox.roost(&["extend", id, "--replicates", "1"]).status.success());
        std::thread::sleep(Duration::from_secs(1));
        page.value::<bool>(&shows(3))
    };
    page.set_hidden(true);
    assert!(!grow(&mut page), "a hidden page keeps its stream");
    page.set_hidden(false);
    page.until("the missed change shows", &shows(3));
    assert!(sandbox.roost(&["extend", id, "--replicates", "1"]).status.success());
    page.until("new changes show again", &shows(4));
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn swagger_ui_runs_under_the_content_security_policy() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    page.go("/docs/");
    page.until("operations are listed", "document.querySelectorAll('.opblock').length > 30");
    let errors = page.errors();
    assert!(errors.is_empty(), "{}", errors.join("\n"));
}

#[test]
fn workers_stay_connected_when_the_viewers_clock_is_wrong() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("bench");
    let mut page = Page::new(&sandbox.address);
    page.open("/workers");
    let connected = "find.rows('1 connected')";
    page.until("the worker is connected", connected);
    page.value::<()>("((Date.now = ((was) => () => was() + 3600e3)(Date.now)), null)");
    // The page polls every five seconds.
    std::thread::sleep(Duration::from_secs(6));
    page.until("the worker is still connected", connected);
    let heartbeat: String = page.value("find.rows('1 connected')[0][11]");
    assert!(heartbeat == "now" || heartbeat.contains(" s ago"), "last heartbeat {heartbeat}");
}
