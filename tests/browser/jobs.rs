//! Running, failed, cancelled and retried jobs on their pages.

use serde_json::json;

use super::page::Page;
use super::support::{Sandbox, hopper_scenario, slow_scenario};
use super::text;

const STATE: &str = "document.querySelector('main .state').textContent";

#[test]
fn jobs_can_be_cancelled_and_retried_and_their_curves_grow() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    let file = sandbox.file(
        "sweep.json",
        &json!({"name": "long", "base": slow_scenario(600.0), "design": {"kind": "grid"}, "replicates": 2}),
    );
    let sweep = sandbox.json_output(&["submit", &file]);
    let id = text(&sweep["id"]);
    let _worker = sandbox.start_worker("bench");
    page.open(&format!("/sweeps/{id}"));
    page.until("a job runs", &format!("{STATE} === 'running'"));

    let running = sandbox.get(&format!("/v1/sweeps/{id}/jobs?state=running"))["items"][0].clone();
    page.open(&format!("/jobs/{}", text(&running["id"])));
    let samples = "find.plot('discharged mass (kg)')?.[0].x.length";
    let some = page.until("a curve of what has been sampled", samples).as_u64().unwrap();
    page.until("the curve grows", &format!("{samples} > {some}"));
    // t = 0 is known: samples that were drawn before it have belt times by now, as those of the API.
    let path = format!("/v1/jobs/{}/series/kinetic_energy", text(&running["id"]));
    page.until(
        "the fill has the times of the API",
        &format!(
            "(async () => {{ const [first] = find.plot('kinetic energy (J)')[0].x, {{ t_s }} = await (await fetch('{path}')).json();
                return first < -0.01 && Math.abs(first - t_s[0]) < 1e-9; }})()"
        ),
    );
    assert_eq!(sandbox.get(&format!("/v1/jobs/{}", text(&running["id"])))["state"], "running");

    page.open(&format!("/sweeps/{id}"));
    page.until("the actions", "find.control('Cancel')");
    let forecast = "document.querySelector('#forecast')?.textContent";
    page.until("when it ends", &format!("{forecast}.match(/Expected to end \\d.* to .*\\d\\./)"));
    // An event leaves an open dialog and its text as they are.
    page.click_named("Extend");
    page.write("More replicates of every point", "3");
    sandbox.json_output(&["cancel", text(&running["id"])]);
    page.until("one is cancelled", "document.querySelector('.counts').textContent.includes('cancelled: 1')");
    let written: String = page.value(
        "document.querySelector('dialog[open] input[name=replicates]')?.value ?? 'the dialog is gone'",
    );
    assert_eq!(written, "3");
    page.click_named("Close");
    page.click_named("Cancel");
    page.until("it is cancelled", &format!("{STATE} === 'cancelled'"));
    assert_eq!(sandbox.get(&format!("/v1/sweeps/{id}"))["counts"]["cancelled"], 2);
    // No row of the table changes any more, yet its times do.
    page.until(
        "time passes in a row that is not drawn again",
        "(() => { const time = document.querySelector('#jobs time');
            if (time !== window.time) { window.time = time; window.text = time.textContent; }
            return time.textContent !== window.text; })()",
    );
    page.until("it can run again", "find.control('Retry')");
    page.click_named("Retry");
    page.click_named("Retry");
    page.until("it runs again", &format!("{STATE} === 'running'"));

    let running = sandbox.get(&format!("/v1/sweeps/{id}/jobs?state=running"))["items"][0].clone();
    page.open(&format!("/jobs/{}", text(&running["id"])));
    page.until("the actions", "find.control('Cancel')");
    page.click_named("Cancel");
    page.until("the job is cancelled", &format!("{STATE} === 'cancelled'"));
    page.until("it can run again", "find.control('Retry')");
    page.click_named("Retry");
    page.until("the job waits or runs", &format!("['queued', 'running'].includes({STATE})"));
    // An attempt that was cancelled before its first sample leaves no result.
    let mut errors = page.errors();
    let result = format!("{}/result", text(&running["id"]));
    errors.retain(|line| !(line.contains("404") && line.contains(&result)));
    assert_eq!(errors, [""; 0]);
}

#[test]
fn failures_by_class_link_to_their_jobs() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server_with_short_leases();
    let worker = sandbox.start_worker("bench");
    let mut page = Page::new(&sandbox.address);
    let mut base = hopper_scenario(0.2);
    base["numerics"]["allow_unstable"] = json!(true);
    base["numerics"]["timestep_s"] = json!(1e-4);
    let factors = json!([{"pointer": "/numerics/timestep_s", "levels": [1e-4, 0.01]}]);
    let file = sandbox.file("sweep.json", &json!({"name": "too coarse", "base": base, "design": {"kind": "grid"}, "factors": factors, "replicates": 2}));
    let sweep = sandbox.json_output(&["submit", &file]);
    let id = text(&sweep["id"]);
    for path in ["/", &format!("/sweeps/{id}")] {
        page.open(path);
        page.until("failures by class", "document.querySelector('a.failure')?.textContent === '2 unstable'");
    }
    assert_eq!(sandbox.get(&format!("/v1/sweeps/{id}"))["failures"]["unstable"], 2);
    page.click("document.querySelector('a.failure')");
    page.until("only unstable jobs", "find.rows('2 jobs')?.every((row) => row[1] === 'failed: unstable')");
    page.choose("Failure class", "lost");
    page.until("no lost jobs", "find.rows('0 jobs')");
    page.choose("Failure class", "");
    page.choose("State", "");
    page.write("Point", "0");
    page.until("jobs of one point", "find.rows('2 jobs')?.every((row) => row[2] === '0')");

    // A retried job has no result yet.
    worker.kill();
    let failed = sandbox.get(&format!("/v1/sweeps/{id}/jobs?state=failed"))["items"][0].clone();
    page.open(&format!("/jobs/{}", text(&failed["id"])));
    page.until("the result", "find.card('Computation')");
    page.click_named("Retry");
    page.until("it waits", &format!("{STATE} === 'queued'"));
    page.until("there is no result", "!find.card('Computation')");
    let reason = "document.querySelector('#forecast')?.textContent";
    page.until("it says why it waits", &format!("{reason}.includes('Waits: no worker is online')"));
    assert_eq!(page.errors(), [""; 0]);
}
