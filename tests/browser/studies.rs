//! Pages of studies: from the question to the answer and its pictures, with results of a real worker.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::page::Page;
use super::plots::numbers;
use super::support::{Sandbox, wait_until};
use super::{audit_pages, text};

const GATE: &str = "/equipment/gate_opening_m";
const BELT: &str = "/equipment/belt_speed_m_s";
const STIFFNESS: &str = "/bonds/normal_stiffness_n_m3";
const SHEAR: &str = "/bonds/shear_stiffness_n_m3";
const STRAIN_RATE: &str = "/compress/strain_rate_1_s";

/// A hopper with two fillets, which is soon empty or jammed.
fn hopper() -> Value {
    json!({"experiment": "hopper", "product": {"count": 2, "subparticle_radius_m": 0.009},
           "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless", "belt_speed_m_s": 0.5},
           "numerics": {"timestep_s": "auto", "duration_s": 6.0, "stop": {"when_empty": true, "when_jammed_s": 0.3}}})
}

/// A block of eight sub-particles.
fn block() -> Value {
    json!({"experiment": "compress", "compress": {"lattice": [2, 2, 2]},
           "numerics": {"timestep_s": "auto", "output_interval_s": 0.0005}})
}

fn factor(pointer: &str, low: f64, high: f64) -> Value {
    json!({"pointer": pointer, "low": low, "high": high})
}

/// Submits a study and returns its id.
fn submit(
    page: &mut Page,
    name: &str,
    base: &Value,
    factors: &[Value],
    goal: &Value,
    max_runs: u32,
) -> String {
    let study = json!({"name": name, "base": base, "factors": factors, "goal": goal, "budget": {"max_runs": max_runs}});
    page.value(&format!(
        "import('/dashboard/api.js').then(({{ post }}) => post('/v1/studies', {study})).then(({{ id }}) => id)"
    ))
}

/// Maximum time of a study, even on a busy machine.
const FINISHED_WITHIN: Duration = Duration::from_secs(300);

/// Waits until a study is finished and opens its page with the picture. Returns the finding.
fn finished(sandbox: &Sandbox, page: &mut Page, id: &str, title: &str) -> Value {
    let since = Instant::now();
    while sandbox.get(&format!("/v1/studies/{id}"))["state"] != "finished" {
        assert!(since.elapsed() < FINISHED_WITHIN, "study {id} is not finished");
        std::thread::sleep(Duration::from_millis(100));
    }
    page.open(&format!("/studies/{id}"));
    page.until(&format!("{title} is drawn"), &format!("find.plot('{title}')"));
    sandbox.get(&format!("/v1/studies/{id}/answer"))["answer"]["finding"].clone()
}

/// The trace of a plot with this name.
fn trace(page: &mut Page, title: &str, name: &str) -> Value {
    let traces: Vec<Value> = page.value(&format!("find.plot('{title}')"));
    let found = traces.iter().find(|trace| trace["name"] == name);
    found.unwrap_or_else(|| panic!("{title} has no {name}: {traces:?}")).clone()
}

/// Numbers of each row at a JSON pointer.
fn column(rows: &Value, pointer: &str) -> Vec<f64> {
    rows.as_array().unwrap().iter().map(|row| row.pointer(pointer).and_then(Value::as_f64).unwrap()).collect()
}

/// The values of a trace and both ends of its intervals are those of the answer.
fn assert_intervals(trace: &Value, estimated: &Value, at: &str) {
    let of = |end: &str| column(estimated, &format!("{at}/{end}"));
    let (value, low, high) = (of("value"), of("low"), of("high"));
    assert_eq!(numbers(&trace["y"]), value);
    for (i, (up, down)) in numbers(&trace["up"]).iter().zip(numbers(&trace["down"])).enumerate() {
        assert!((value[i] + up - high[i]).abs() < 1e-9 && (value[i] - down - low[i]).abs() < 1e-9, "{trace}");
    }
}

#[test]
fn study_runs_from_its_question_to_its_answer() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    page.open("/studies");
    page.until("no study is listed", "document.querySelector('main').innerText.includes('No studies yet')");
    let jammed = json!({"probability": "jammed"});
    let goal =
        json!({"estimate": {"points": [[0.02], [0.12]], "intervals": [{"of": jammed, "width": 0.75}]}});
    let id = submit(&mut page, "two gates", &hopper(), &[factor(GATE, 0.02, 0.12)], &goal, 20);
    page.until("the study is listed", "find.rows('1 study,')");
    let show = || sandbox.get(&format!("/v1/studies/{id}"));
    page.click_named("two gates");
    page.until("the question", "document.querySelector('#question')");
    let question: String = page.value("document.querySelector('#question').textContent");
    assert_eq!(question, text(&show()["question"]).replace('`', ""));

    let state = |word: &str| format!("document.querySelector('#runs .state').textContent === '{word}'");
    page.click_named("Pause");
    page.until("the study is paused", &state("paused"));
    assert_eq!(show()["state"], "paused");
    page.click_named("Resume");
    page.until("the study goes on", &state("running"));
    assert_eq!(show()["state"], "running");

    page.value::<()>("(window.seen = true, null)");
    let _worker = sandbox.start_worker("bench");
    page.until("the study ends", &state("finished: as certain as asked"));
    page.until(
        "the picture has both points, as narrow as asked",
        "(([one]) => one.name === 'as narrow as asked' && one.x.length === 2)(find.plot('Estimate: probability of jammed') ?? [{}])",
    );
    assert!(page.value::<bool>("window.seen"), "the page was loaded again");
    // A run in flight may still end, and change the answer.
    let done = wait_until("no run is in flight", || {
        let runs = show()["runs"].clone();
        (runs["pending"] == 0).then(|| runs["done"].clone())
    });
    let answer = sandbox.get(&format!("/v1/studies/{id}/answer"));
    let points = &answer["answer"]["finding"]["estimate"]["points"];
    let values: Vec<_> = column(points, "/measures/0/estimated/value").iter().map(f64::to_string).collect();
    page.until(
        "the newest answer is drawn",
        &format!("[...find.plot('Estimate: probability of jammed')[0].y].join() === '{}'", values.join(",")),
    );
    let drawn = trace(&mut page, "Estimate: probability of jammed", "as narrow as asked");
    assert_eq!(numbers(&drawn["x"]), [0.02, 0.12]);
    assert_intervals(&drawn, points, "/measures/0/estimated");
    assert!(numbers(&drawn["y"])[0] > numbers(&drawn["y"])[1], "narrow gates jam: {drawn}");
    let sentences: Vec<String> =
        page.value("[...document.querySelectorAll('#answer li')].map((one) => one.textContent)");
    let stated = answer["study"]["answer"].as_array().unwrap();
    assert_eq!(sentences, stated.iter().map(|line| text(line).replace('`', "")).collect::<Vec<_>>());
    for count in [format!("{done} done"), "budget of 20 runs".to_owned()] {
        page.until(&count, &format!("document.querySelector('#runs').innerText.includes('{count}')"));
    }

    page.click_named("Raise budget");
    page.write("Maximum number of runs", "25");
    page.click_named("Raise budget");
    page.until(
        "the budget has grown",
        "document.querySelector('#runs').innerText.includes('budget of 25 runs')",
    );
    assert_eq!(show()["runs"]["max_runs"], 25);
    page.until("the study is finished again", &state("finished: as certain as asked"));

    page.click_named("Widen ranges");
    page.write("Highest gate opening (m)", "0.15");
    page.click_named("Widen ranges");
    let grown = "gate opening was 0.02 to 0.12 m and is 0.02 to 0.15 m now";
    page.until(
        "the range has grown",
        &format!("document.querySelector('#answer').innerText.includes('{grown}')"),
    );
    // The dialog opens with the present range.
    page.until("the study is finished once more", &state("finished: as certain as asked"));
    wait_until("the new range", || {
        page.click_named("Widen ranges");
        page.until("the dialog", "document.querySelector('dialog[open]')");
        let is_new = page.value::<bool>("find.field('Highest gate opening (m)').value === '0.15'");
        // The page reads the ranges after the state.
        if !is_new {
            page.click_named("Close");
        }
        is_new.then_some(())
    });
    page.write("Lowest gate opening (m)", "0.03");
    page.click_named("Widen ranges");
    page.until("a smaller range is refused", "find.field('Lowest gate opening (m)').matches(':invalid')");
    page.click_named("Close");
    audit_pages(&mut page, &["/studies", &format!("/studies/{id}")]);
    page.click_named("Results and runs in flight");
    page.until("the sweep of the study", &format!("location.pathname === '/sweeps/{id}'"));
    page.until("its runs are chosen by the study", "find.control('Clone') && !find.control('Extend')");
    page.click_named("Question and answer of the study");
    page.until("the study again", &format!("location.pathname === '/studies/{id}'"));
}

#[test]
fn a_cancelled_study_offers_no_further_action() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    page.open("/studies");
    let goal = json!({"estimate": {"points": [[0.02]], "intervals": [{"of": {"probability": "jammed"}, "width": 0.5}]}});
    let id = submit(&mut page, "ends", &hopper(), &[factor(GATE, 0.02, 0.12)], &goal, 20);
    page.open(&format!("/studies/{id}"));
    page.click_named("Cancel");
    page.until("it is cancelled", "document.querySelector('#runs .state').textContent === 'cancelled'");
    for name in ["Pause", "Resume", "Cancel", "Raise budget", "Widen ranges"] {
        page.until(&format!("{name} is gone"), &format!("find.control('{name}') === undefined"));
    }
    assert_eq!(sandbox.get(&format!("/v1/studies/{id}"))["state"], "cancelled");
}

#[test]
fn two_factors_of_a_map_are_along_its_axes() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    page.open("/studies");
    let mut changed = |slice: Value, factor: usize, value: Value| -> Value {
        page.value(&format!(
            "import('/dashboard/plots/studies/boundary.js').then(({{ changedSlice }}) => changedSlice({slice}, {factor}, {value}, Array(4).fill([1, 2, 3])))"
        ))
    };
    let slice = json!([null, null, 2, 3]);
    assert_eq!(changed(slice.clone(), 2, json!(1)), json!([null, null, 1, 3]), "another value");
    assert_eq!(changed(slice.clone(), 1, json!(3)), json!([null, 3, null, 3]), "a factor leaves the axes");
    assert_eq!(changed(slice, 3, Value::Null), json!([2, null, 2, null]), "a factor joins the axes");
}

#[test]
fn pictures_of_boundaries_optima_and_sensitivities_match_their_answers() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("bench");
    let mut page = Page::new(&sandbox.address);
    page.open("/studies");
    let (gate, stiffness, rate) =
        (factor(GATE, 0.02, 0.12), factor(STIFFNESS, 1e6, 4e6), factor(STRAIN_RATE, 0.5, 3.0));
    let jammed = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.5}});
    let modulus = json!({"mean": "modulus_pa"});
    let optimum = json!({"optimise": {"objectives": [{"minimise": modulus}]}});
    let sensitivity = json!({"sensitivity": {"of": [modulus], "width": 0.5, "method": "morris"}});
    let one = submit(&mut page, "smallest gate", &hopper(), std::slice::from_ref(&gate), &jammed, 24);
    let two = submit(&mut page, "gate and belt", &hopper(), &[gate, factor(BELT, 0.2, 1.0)], &jammed, 36);
    let best = submit(&mut page, "softest block", &block(), std::slice::from_ref(&stiffness), &optimum, 40);
    let matter = submit(&mut page, "what matters", &block(), &[stiffness, rate], &sensitivity, 64);

    let finding = &finished(&sandbox, &mut page, &one, "Boundary")["boundary"];
    let estimate = trace(&mut page, "Boundary", "estimate");
    assert_eq!(numbers(&estimate["x"]), column(&finding["map"], "/values/0"));
    assert_eq!(numbers(&estimate["y"]), column(&finding["map"], "/estimate"));
    assert_eq!(numbers(&trace(&mut page, "Boundary", "low")["y"]), column(&finding["map"], "/low"));
    assert_eq!(numbers(&trace(&mut page, "Boundary", "95 % band")["y"]), column(&finding["map"], "/high"));
    let observed = trace(&mut page, "Boundary", "runs at a point, 95 % interval");
    assert_eq!(numbers(&observed["x"]), column(&finding["observed"], "/values/0"));
    assert_intervals(&observed, &finding["observed"], "/estimated");

    let finding = &finished(&sandbox, &mut page, &two, "Boundary")["boundary"];
    let boundary = trace(&mut page, "Boundary", "boundary at 0.5");
    let cells: Vec<f64> = boundary["z"].as_array().unwrap().iter().flat_map(numbers).collect();
    // The map of the answer has the last factor vary fastest: it is a column of the picture.
    let (rows, columns) = (boundary["y"].as_array().unwrap().len(), boundary["x"].as_array().unwrap().len());
    let transposed: Vec<f64> = (0..columns)
        .flat_map(|x| (0..rows).map(move |y| (x, y)))
        .map(|(x, y)| cells[y * columns + x])
        .collect();
    assert_eq!(transposed, column(&finding["map"], "/estimate"));
    let points = trace(&mut page, "Boundary", "points");
    assert_eq!(numbers(&points["y"]), column(&finding["observed"], "/values/1"));

    let finding = &finished(&sandbox, &mut page, &best, "Recommended point")["optimise"];
    let drawn: Vec<Value> = page.value("find.plot('Recommended point')");
    let recommended = finding["recommended"].as_array().unwrap();
    assert!(!recommended.is_empty(), "{finding}");
    assert_eq!(numbers(&drawn[0]["x"]), column(&finding["recommended"], "/values/0"));

    let title = "Sensitivity: mean of modulus (Pa)";
    let finding = &finished(&sandbox, &mut page, &matter, title)["sensitivity"];
    let effects = finding["measures"][0]["effects"]["morris"].as_array().unwrap();
    let bars = trace(&mut page, title, "mean absolute effect");
    for (label, (x, up)) in
        bars["y"].as_array().unwrap().iter().zip(numbers(&bars["x"]).iter().zip(numbers(&bars["right"])))
    {
        let name = text(label).split(" (").next().unwrap().replace(' ', "_");
        let effect = effects.iter().find(|one| text(&one["factor"]).contains(&name)).unwrap();
        let at = |end: &str| effect["mu_star"][end].as_f64().unwrap();
        assert!(*x == at("value") && (x + up - at("high")).abs() < 1e-9, "{label}: {effect}");
    }
    let paths: Vec<String> = [one, two, best, matter].iter().map(|id| format!("/studies/{id}")).collect();
    audit_pages(&mut page, &paths.iter().map(String::as_str).collect::<Vec<_>>());
}

#[test]
fn pictures_of_a_calibration_match_its_answer() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("bench");
    let mut page = Page::new(&sandbox.address);
    page.open("/studies");
    let points = json!([{"x": 0.02, "mean": 250.0, "deviation": 20.0, "n": 4}, {"x": 0.06, "mean": 800.0, "deviation": 60.0, "n": 4}]);
    let measured = json!({
        "responses": [{"response": "modulus_pa", "unit": "kPa", "mean": 12.0, "deviation": 1.0, "n": 4}],
        "curves": [{"x": "strain", "y": "stress", "y_unit": "Pa", "points": points}],
    });
    let lab = json!({"name": "lab", "tests": [{"name": "block", "scenario": block(), "measured": measured}]});
    let goal = json!({"calibrate": {"measurements": lab}});
    let factors = [factor(STIFFNESS, 1e6, 4e6), factor(SHEAR, 2e5, 2e6)];
    let id = submit(&mut page, "stiffness of a block", &Value::Null, &factors, &goal, 40);
    let title = "Simulated and measured curves";
    let found = finished(&sandbox, &mut page, &id, title)["calibrate"].clone();
    let traces: Vec<Value> = page.value("find.plot('Parameters')");
    let samples = traces.iter().find(|one| one["type"] == "scatter" && one["name"].is_null()).unwrap();
    assert_eq!(numbers(&samples["x"]), column(&found["samples"], "/0"));
    assert_eq!(numbers(&samples["y"]), column(&found["samples"], "/1"));
    let best = trace(&mut page, "Parameters", "most probable set");
    assert_eq!(numbers(&best["x"]), [found["parameters"][0]["best"].as_f64().unwrap()]);

    let targets = found["targets"].as_array().unwrap();
    let is_point = |target: &&Value| target["target"]["curve"].is_object();
    let (of_curve, others): (Vec<&Value>, Vec<&Value>) = targets.iter().partition(is_point);
    assert_eq!((of_curve.len(), others.len()), (2, 1));
    let number = trace(&mut page, "Simulated and measured", "simulated, 95 %");
    let mean = |target: &Value| target["simulated"]["mean"].as_f64().unwrap();
    assert_eq!(numbers(&number["x"]), [mean(others[0]) / 12_000.0]);
    let simulated = trace(&mut page, title, "simulated, 95 %");
    assert_eq!(numbers(&simulated["x"]), [0.02, 0.06]);
    assert_eq!(numbers(&simulated["y"]), [mean(of_curve[0]), mean(of_curve[1])]);
    let measured = trace(&mut page, title, "measured, mean ± 2 standard errors");
    assert_eq!((numbers(&measured["y"]), numbers(&measured["up"])), (vec![250.0, 800.0], vec![20.0, 60.0]));
    audit_pages(&mut page, &[&format!("/studies/{id}")]);
}
