//! A hundred thousand jobs: the page of their sweep opens at once, turns pages and filters.

use std::time::Duration;

use serde_json::json;

use super::page::Page;
use super::support::Home;
use super::text;

const JOBS: u64 = 100_000;
/// What the dashboard promises.
const AT_ONCE: Duration = Duration::from_secs(2);

#[test]
fn a_hundred_thousand_jobs_open_turn_and_filter_at_once() {
    let home = Home::new();
    let _server = home.serve();
    let mut page = Page::new(&home.address);
    let base = json!({"experiment": "compress", "compress": {"lattice": [2, 2, 2]}, "numerics": {"timestep_s": "auto"}});
    let design = json!({"kind": "random", "points": JOBS / 100});
    let factors = json!([{"pointer": "/compress/strain_rate_1_s", "low": 0.5, "high": 2.0}]);
    let file = home.file(
        "sweep.json",
        &json!({"name": "many", "base": base, "design": design, "factors": factors, "replicates": 20}),
    );
    let sweep = home.answered(&["submit", &file]);
    // Piece by piece: the command waits a minute for an answer, which is not long where much else is done.
    for _ in 0..4 {
        assert!(home.roost(&["extend", text(&sweep["id"]), "--replicates", "20"]).status.success());
    }
    let path = format!("/sweeps/{}", text(&sweep["id"]));
    // What a browser keeps from earlier visits.
    page.open("/");

    page.open(&path);
    let first = "find.rows('100 jobs')?.[0][0]";
    page.until("jobs are listed", first);
    let took: f64 = page.value("performance.now()");
    assert!(took < 1000.0 * AT_ONCE.as_secs_f64(), "the page took {took} ms");
    println!("{JOBS} jobs: listed {took:.0} ms after the page was asked for");
    page.until("all are counted", "document.querySelector('main').innerText.includes('of 100,000 jobs')");

    let newest = page.until("the newest job", first);
    for (press, is_so) in [("Older", "!=="), ("Newer", "===")] {
        let (_, took) = page.timed(|page| {
            page.press_named(press);
            page.until("another page", &format!("{first} {is_so} {newest}"));
        });
        assert!(took < AT_ONCE, "{press} took {took:?}");
    }
    let (_, took) = page.timed(|page| {
        page.write("Point", "123");
        page.until("jobs of one point", "find.rows('100 jobs')?.every((row) => row[2] === '123')");
    });
    assert!(took < AT_ONCE, "the filter took {took:?}");
    page.choose("State", "running");
    page.until("none runs", "find.rows('0 jobs')");
    let complaints = page.complaints();
    assert!(complaints.is_empty(), "{complaints:?}");
}
