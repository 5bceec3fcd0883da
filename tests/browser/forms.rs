//! The plots of drop, bend, slide and compress, from results of a real worker.

use serde_json::{Value, json};

use super::page::Page;
use super::plots::numbers;
use super::support::Sandbox;
use super::text;

const STRAIN_RATE: &str = "/compress/strain_rate_1_s";
const SPEED: &str = "/drop/speed_m_s";
const STIFFNESS: &str = "/bonds/normal_stiffness_n_m3";
const FRICTION: &str = "/contact/fillet_equipment/static_friction";

/// Runs a small sweep of each experiment and returns their ids.
pub(crate) fn run_sweeps(sandbox: &Sandbox) -> Vec<String> {
    let auto = json!({"timestep_s": "auto"});
    let levels = |pointer: &str, levels: &[f64]| json!([{"pointer": pointer, "levels": levels}]);
    let tests = [
        (
            json!({"experiment": "drop", "product": {"count": 1, "subparticle_radius_m": 0.009}, "drop": {"scatter_deg": 5}, "numerics": auto}),
            levels(SPEED, &[2.0, 8.0]),
        ),
        (
            json!({"experiment": "bend", "product": {"subparticle_radius_m": 0.009}, "bend": {"scatter_deg": 5}, "numerics": {"timestep_s": "auto", "duration_s": 2.0}}),
            levels(STIFFNESS, &[1e6, 3e6]),
        ),
        (
            json!({"experiment": "slide", "product": {"subparticle_radius_m": 0.009}, "slide": {"tilt_rate_deg_s": 30, "scatter_deg": 5}, "numerics": auto}),
            levels(FRICTION, &[0.3, 0.6]),
        ),
        (
            json!({"experiment": "compress", "compress": {"lattice": [2, 2, 2]}, "numerics": {"timestep_s": "auto", "output_interval_s": 0.0005}}),
            levels(STRAIN_RATE, &[1.0, 2.0]),
        ),
    ];
    tests
        .iter()
        .map(|(base, factors)| {
            let file = sandbox.file("sweep.json", &json!({"name": base["experiment"], "base": base, "design": {"kind": "grid"}, "factors": factors, "replicates": 2}));
            text(&sandbox.json_output(&["submit", "--wait", &file])["id"]).to_owned()
        })
        .collect()
}

/// Compares the plot of each experiment with the API.
pub(crate) fn match_the_api(sandbox: &Sandbox, page: &mut Page, sweeps: &[String]) {
    let mut open = |sweep: &str, title: &str| -> (Vec<Value>, Vec<Value>) {
        page.open(&format!("/sweeps/{sweep}"));
        page.until(&format!("{title} is drawn"), &format!("find.plot('{title}')"));
        let traces = page.value(&format!("find.plot('{title}')"));
        (
            traces,
            sandbox.get(&format!("/v1/sweeps/{sweep}/results?by=point"))["points"]
                .as_array()
                .unwrap()
                .clone(),
        )
    };
    let (traces, points) = open(&sweeps[0], "Bonds intact over impact speed");
    means(&traces[0], &points, SPEED, "bonds_intact_fraction");

    let (traces, points) = open(&sweeps[1], "Bend angle");
    means(&traces[0], &points, STIFFNESS, "bend_angle_deg");
    // The tangent of a centre line turns by the bend angle from end to end, within one step.
    let centre_lines: Vec<&Value> =
        traces.iter().filter(|trace| trace["x"].as_array().unwrap().len() > 20).collect();
    assert_eq!(centre_lines.len(), 2);
    for (line, row) in centre_lines.iter().zip(&points) {
        let at = |i: usize| (line["x"][i].as_f64().unwrap(), line["y"][i].as_f64().unwrap());
        let turn = |i: usize| (at(i + 1).1 - at(i).1).atan2(at(i + 1).0 - at(i).0).to_degrees();
        let last = line["x"].as_array().unwrap().len() - 2;
        let (turned, angle) = (turn(0) - turn(last), mean(row, "bend_angle_deg"));
        assert!((turned / angle - 1.0).abs() < 0.06, "turns by {turned}°, not {angle}°");
    }

    let (traces, points) = open(&sweeps[2], "Angle of sliding over friction");
    means(&traces[0], &points, FRICTION, "critical_angle_deg");
    let ideal = traces.iter().find(|trace| trace["name"] == "atan μ").unwrap();
    for (i, friction) in ideal["x"].as_array().unwrap().iter().enumerate() {
        let angle = friction.as_f64().unwrap().atan().to_degrees();
        assert!((ideal["y"][i].as_f64().unwrap() - angle).abs() < 1e-9);
    }

    let (traces, _) = open(&sweeps[3], "Stress over strain");
    let mut curves = 0;
    for trace in &traces {
        let Some(path) = trace["customdata"][0].as_str() else { continue };
        let result = sandbox.get(&format!("/v1{path}/result"));
        let curve =
            result["curves"].as_array().unwrap().iter().find(|curve| curve["name"] == "stress").unwrap();
        assert_eq!(numbers(&trace["x"]), numbers(&curve["x"]));
        assert_eq!(numbers(&trace["y"]), numbers(&curve["values"]));
        curves += 1;
    }
    assert_eq!(curves, 4, "every trial has its curve");
}

fn mean(row: &Value, response: &str) -> f64 {
    row["responses"][response]["mean"].as_f64().unwrap()
}

/// Compares a line of means and intervals over a factor.
fn means(trace: &Value, points: &[Value], factor: &str, response: &str) {
    let (x, y, up) = (numbers(&trace["x"]), numbers(&trace["y"]), numbers(&trace["up"]));
    assert_eq!(x.len(), points.len());
    for (i, row) in points.iter().enumerate() {
        let high = row["responses"][response]["high_95"].as_f64().unwrap();
        assert_eq!((x[i], y[i]), (row["factors"][factor].as_f64().unwrap(), mean(row, response)));
        assert!((up[i] - (high - mean(row, response))).abs() < 1e-9, "the interval at {}", x[i]);
    }
}
