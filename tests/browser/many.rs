//! A sweep of a hundred thousand jobs: its page lists and filters them within two seconds.

use std::time::Duration;

use serde_json::json;

use super::page::Page;
use super::support::{self, Sandbox};
use super::text;

const JOBS: u64 = 100_000;
/// The promised time.
const PROMISED: Duration = Duration::from_secs(2);

/// Repeats an act that the machine has delayed, up to twice. Returns the shortest time.
fn best_of_three(mut act: impl FnMut() -> Duration) -> Duration {
    let mut best = Duration::MAX;
    for _ in 0..3 {
        best = best.min(act());
        if best < PROMISED {
            break;
        }
    }
    best
}

#[test]
fn a_hundred_thousand_jobs_list_and_filter_within_two_seconds() {
    let _alone = support::turn::alone();
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    let base = json!({"experiment": "compress", "compress": {"lattice": [2, 2, 2]}, "numerics": {"timestep_s": "auto"}});
    let design = json!({"kind": "random", "points": JOBS / 100});
    let factors = json!([{"pointer": "/compress/strain_rate_1_s", "low": 0.5, "high": 2.0}]);
    let file = sandbox.file(
        "sweep.json",
        &json!({"name": "many", "base": base, "design": design, "factors": factors, "replicates": 20}),
    );
    let sweep = sandbox.json_output(&["submit", &file]);
    // In parts: one request for all jobs could exceed the command's timeout of a minute on a busy machine.
    for _ in 0..4 {
        assert!(sandbox.roost(&["extend", text(&sweep["id"]), "--replicates", "20"]).status.success());
    }
    let path = format!("/sweeps/{}", text(&sweep["id"]));
    // Fills the browser's cache.
    page.open("/");

    let first = "find.rows('100 jobs')?.[0][0]";
    let took = best_of_three(|| {
        page.open(&path);
        page.until("jobs are listed", first);
        Duration::from_secs_f64(page.value::<f64>("performance.now()") / 1000.0)
    });
    assert!(took < PROMISED, "the page took {took:?}");
    println!("{JOBS} jobs: listed {took:?} after the page was asked for");
    page.until("all are counted", "document.querySelector('main').innerText.includes('of 100,000 jobs')");

    let newest = page.until("the newest job", first);
    let took = best_of_three(|| {
        let both = [("Older", "!=="), ("Newer", "===")].map(|(press, is_so)| {
            let turned = page.timed(|page| {
                page.click_named(press);
                page.until("another page", &format!("{first} {is_so} {newest}"));
            });
            turned.1
        });
        both[0].max(both[1])
    });
    assert!(took < PROMISED, "Older or Newer took {took:?}");
    let mut is_again = false;
    let took = best_of_three(|| {
        if is_again {
            page.write("Point", "7");
            page.until("jobs of another", "find.rows('100 jobs')?.every((row) => row[2] === '7')");
        }
        is_again = true;
        let filtered = page.timed(|page| {
            page.write("Point", "123");
            page.until("jobs of one point", "find.rows('100 jobs')?.every((row) => row[2] === '123')");
        });
        filtered.1
    });
    assert!(took < PROMISED, "the filter took {took:?}");
    page.choose("State", "running");
    page.until("none runs", "find.rows('0 jobs')");
    let errors = page.errors();
    assert!(errors.is_empty(), "{errors:?}");
}
