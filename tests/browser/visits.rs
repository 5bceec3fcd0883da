//! Pages that are left and come back to, by people whose clocks may be wrong.

use std::time::Duration;

use serde_json::json;

use super::page::Page;
use super::support::{Home, scenario};
use super::text;

#[test]
fn a_page_follows_while_it_is_seen() {
    let home = Home::new();
    let _server = home.serve();
    let mut page = Page::new(&home.address);
    let file = home.file(
        "sweep.json",
        &json!({"name": "waits", "base": scenario(0.2), "design": {"kind": "grid"}, "replicates": 2}),
    );
    let sweep = home.answered(&["submit", &file]);
    let id = text(&sweep["id"]);
    page.open(&format!("/sweeps/{id}"));
    let shows = |replicates: u64| {
        format!("document.querySelector('.facts').textContent.includes('1 point × {replicates}')")
    };
    page.until("the page is there", &shows(2));
    let grow = |page: &mut Page| {
        assert!(home.roost(&["extend", id, "--replicates", "1"]).status.success());
        std::thread::sleep(Duration::from_secs(1));
        page.value::<bool>(&shows(3))
    };
    page.look_away(true);
    assert!(!grow(&mut page), "a page that nobody sees keeps its stream");
    page.look_away(false);
    page.until("what happened meanwhile shows", &shows(3));
    assert!(home.roost(&["extend", id, "--replicates", "1"]).status.success());
    page.until("what happens shows again", &shows(4));
    assert!(page.complaints().is_empty());
}

#[test]
fn the_reader_of_the_specification_shows_it_under_its_policy() {
    let home = Home::new();
    let _server = home.serve();
    let mut page = Page::new(&home.address);
    page.go("/docs/");
    page.until("operations are listed", "document.querySelectorAll('.opblock').length > 30");
    let complaints = page.complaints();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn workers_are_there_whatever_the_viewers_clock_says() {
    let home = Home::new();
    let _server = home.serve();
    let _worker = home.work("bench");
    let mut page = Page::new(&home.address);
    page.open("/workers");
    let there = "find.rows('1 there')";
    page.until("the worker is there", there);
    page.value::<()>("((Date.now = ((was) => () => was() + 3600e3)(Date.now)), null)");
    // The page looks every five seconds.
    std::thread::sleep(Duration::from_secs(6));
    page.until("the worker is there still", there);
    let heard: String = page.value("find.rows('1 there')[0][11]");
    assert!(heard == "now" || heard.contains(" s ago"), "last heard {heard}");
}
