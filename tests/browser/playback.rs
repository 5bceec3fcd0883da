//! Playback of a job: frames play, step and turn, with the sub-particles of the run.

use std::time::Duration;

use serde_json::Value;

use super::page::Page;
use super::support::Sandbox;
use super::text;

/// Frames of a simulated second.
const FRAMES_PER_S: f64 = 20.0;

const SHOWN: &str = "Number(document.querySelector('canvas').dataset.frame)";

/// Plays the first job of a sweep; returns that job.
pub(crate) fn plays(sandbox: &Sandbox, page: &mut Page, sweep: &str) -> String {
    let jobs = sandbox.get(&format!("/v1/sweeps/{sweep}/jobs?point=0&limit=1"));
    let id = text(&jobs["items"][0]["id"]).to_owned();
    let result = sandbox.get(&format!("/v1/jobs/{id}/result"));
    let frames = sandbox.get(&format!("/v1/jobs/{id}"))["frames"].clone();
    let count = frames["count"].as_u64().unwrap();
    assert!(count > 30, "{frames}");
    page.open(&format!("/jobs/{id}"));
    page.until("the first frame", "document.querySelector('canvas')?.dataset.frame === '0'");
    let line = "find.field('Frame')";
    assert_eq!(page.value::<u64>(&format!("Number({line}.max)")) + 1, count);
    let subparticles: Value = page.value("Number(document.querySelector('canvas').dataset.subparticles)");
    assert_eq!(subparticles.as_u64(), result["performance"]["subparticles"].as_u64());

    // A change of speed continues from the same frame. Soon back to the lower one: at the other the frames end within two seconds.
    page.choose("Speed", "0.1");
    page.click_named("Play");
    std::thread::sleep(Duration::from_millis(1500));
    let (before, after, elapsed_s): (f64, f64, f64) = page.value(&format!(
        "new Promise((done) => {{ const before = {SHOWN}, began = performance.now(), speed = find.field('Speed');
            const choose = (value) => {{ speed.value = value; speed.dispatchEvent(new Event('change')); }};
            choose('1');
            setTimeout(() => {{ const after = {SHOWN}; choose('0.1'); done([before, after, (performance.now() - began) / 1000]); }}, 100); }})"
    ));
    let due = before + FRAMES_PER_S * elapsed_s;
    assert!(after < due + 10.0, "from frame {before} to {after} within {elapsed_s} s");
    page.click_named("Pause");
    page.value::<()>(&format!("(({line}.value = 0), {line}.dispatchEvent(new Event('input')), null)"));
    page.until("the first frame again", &format!("{SHOWN} === 0 || null"));

    // Slow enough for a busy machine, and images that follow each other without a pause.
    page.choose("Speed", "0.25");
    page.click_named("Play");
    let moved = page.until("it plays", &format!("{SHOWN} > 2 && {SHOWN}")).as_u64().unwrap();
    page.until("it plays on", &format!("{SHOWN} > {moved}"));
    page.until("a frame time", "Number(document.querySelector('canvas').dataset.frame_ms) > 0");
    page.click_named("Pause");
    let simulated: f64 = page.value("Number(document.querySelector('canvas').dataset.simulated_s)");
    assert!(simulated > 0.0);

    // Keys, the time line and the image.
    page.until("the frame of the pause", &format!("{SHOWN} === Number({line}.value)"));
    let before: u64 = page.value(SHOWN);
    page.value::<()>("(document.querySelector('canvas').focus(), null)");
    page.key(".");
    page.until("a step on", &format!("{SHOWN} === {}", before + 1));
    page.value::<()>(&format!(
        "(({line}.value = {line}.max), {line}.dispatchEvent(new Event('input')), null)"
    ));
    page.until("the last frame", &format!("{SHOWN} === {}", count - 1));
    let seen = colours(page);
    assert!(seen > 20, "{seen} colours: nothing is drawn");
    page.choose("Colour by", "speed");
    page.until("a scale of speeds", "document.querySelector('.legend').checkVisibility()");
    let before: String = page.value("new URLSearchParams(location.search).get('colour')");
    assert_eq!(before, "speed");
    let (from, to) = ((0.5, 0.5), (0.7, 0.6));
    page.drag("document.querySelector('canvas')", from, to);
    page.click_named("Play");
    page.click_named("Pause");
    let view: String = page.value("new URLSearchParams(location.search).get('view')");
    assert!(!view.starts_with("-1.10,0.35"), "the view has not turned: {view}");
    id
}

/// The number of different colours on the canvas, which is copied before the browser clears it.
fn colours(page: &mut Page) -> usize {
    page.value(
        "new Promise((done) => { const canvas = document.querySelector('canvas'); dispatchEvent(new Event('resize'));
            requestAnimationFrame(() => { canvas.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft' }));
            requestAnimationFrame(() => { const small = new OffscreenCanvas(64, 48), paper = small.getContext('2d');
            paper.drawImage(canvas, 0, 0, 64, 48); const bytes = new Uint32Array(paper.getImageData(0, 0, 64, 48).data.buffer);
            done(new Set(bytes).size); }); }); })",
    )
}
