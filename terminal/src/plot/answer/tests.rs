//! Pictures of real answers: studies of synthetic truths, driven to their ends.

use roost_design::{Evidence, Outcome, Question, Run, decide};
use serde_json::{Value, json};

use super::*;

const GATE: &str = "/equipment/gate_opening_m";
const SPEED: &str = "/equipment/belt_speed_m_s";
const FRICTION: &str = "/contact/fillet_belt/static_friction";

/// Log odds of a jam at a gate opening and a belt speed.
fn jam(gate: f64, speed: f64) -> f64 {
    400.0 * (0.052 + 0.01 * speed - gate)
}

/// The responses of a run at values of gate opening, belt speed and friction, as far as the study has them.
fn simulate(values: &[f64], random: &mut fastrand::Rng) -> Outcome {
    let at = |index: usize, otherwise: f64| values.get(index).copied().unwrap_or(otherwise);
    let (gate, speed, friction) = (at(0, 0.05), at(1, 0.3), at(2, 0.5));
    let probability = 1.0 / (1.0 + (-jam(gate, speed) - 4.0 * (friction - 0.5)).exp());
    let noise = 0.05 * (random.f64() + random.f64() + random.f64() - 1.5);
    let responses = [
        ("jammed", f64::from(u8::from(random.f64() < probability))),
        ("mean_rate_kg_s", 120.0 * gate * speed * (0.8 + 0.4 * friction) + noise),
        ("curl_angle_deg", 30.0 + 60.0 * (speed - 0.3).powi(2) + 200.0 * gate + 10.0 * noise),
        ("discharged_mass_kg@time_s=1", 100.0 * gate * speed + noise),
        ("discharged_mass_kg@time_s=2", 210.0 * gate * speed + noise),
    ];
    Outcome::Responses(responses.map(|(name, value)| (name.to_owned(), value)).into())
}

/// Factors of the scenario.
fn factors(count: usize) -> Value {
    let all = [
        json!({"pointer": GATE, "low": 0.03, "high": 0.08}),
        json!({"pointer": SPEED, "low": 0.1, "high": 1.0, "scale": "log"}),
        json!({"pointer": FRICTION, "low": 0.2, "high": 0.8}),
    ];
    json!(all[..count])
}

/// The answer of a study with this goal and budget, when its runs have ended.
fn answer(factors: &Value, goal: Value, max_runs: usize) -> StudyAnswer {
    let mut named = factors.clone();
    for factor in named.as_array_mut().unwrap() {
        let pointer = factor.as_object_mut().unwrap().remove("pointer").unwrap();
        if pointer == "/product/count" {
            factor["is_whole"] = json!(true);
        }
        factor["name"] = pointer;
    }
    let question = json!({"factors": named, "goal": goal, "budget": {"max_runs": max_runs}});
    let question = Question::read(&question).unwrap();
    let mut random = fastrand::Rng::with_seed(7);
    let mut runs = Vec::new();
    let answer = loop {
        let decision = decide(&question, &Evidence::new(runs.clone()), 16, 3);
        if decision.finished.is_some() || decision.proposals.is_empty() {
            break decision.answer;
        }
        runs.extend(decision.proposals.into_iter().map(|proposal| Run {
            outcome: simulate(&proposal.point.values(&question.factors), &mut random),
            point: proposal.point,
            replicate: proposal.replicate,
        }));
    };
    let names: Vec<&str> = question.factors.iter().map(|factor| factor.name.as_str()).collect();
    let study = json!({
        "id": "01890a5d-ac96-774b-bcce-b302099a8057", "name": "smallest safe gate", "state": "finished",
        "finished": "by_rule", "question": "Where is the probability of `jammed` equal to 0.05?",
        "answer": ["The first sentence of the answer."], "factors": names, "points": 9,
        "runs": {"done": runs.len(), "failed": 0, "cancelled": 0, "pending": 0, "max_runs": max_runs},
        "submitted_at": "2026-01-01T00:00:00Z", "answered_at": "2026-01-01T00:00:01Z"
    });
    let document = json!({"study": study, "factors": factors, "goal": goal, "answer": answer});
    serde_json::from_value(document).unwrap()
}

/// The picture of an answer. It is also written to the folder in `ROOST_KEEP_PLOTS`, for inspection.
fn picture(name: &str, answer: &StudyAnswer, texts: &[&str]) -> String {
    let drawn = answer_svg(answer).unwrap();
    if let Some(folder) = std::env::var_os("ROOST_KEEP_PLOTS") {
        std::fs::write(std::path::Path::new(&folder).join(format!("answer-{name}.svg")), &drawn).unwrap();
    }
    let document = roxmltree::Document::parse(&drawn).unwrap_or_else(|error| panic!("{name}: {error}"));
    let head = ["smallest safe gate", "The first sentence of the answer."];
    let written: Vec<&str> = document.descendants().filter_map(|node| node.text()).map(str::trim).collect();
    for text in texts.iter().chain(&head) {
        assert!(written.contains(text), "{name}: no `{text}` in {written:?}");
    }
    let height: f64 = document.root_element().attribute("height").unwrap().parse().unwrap();
    for node in document.descendants() {
        for (attribute, end) in [("x", 860.0), ("y", height), ("cx", 860.0), ("cy", height)] {
            let place = node.attribute(attribute).map_or(0.0, |place| place.parse().unwrap());
            assert!((0.0..=end).contains(&place), "{name}: {attribute} = {place}");
        }
    }
    drawn
}

/// Centre and radius of the circles with a fill and this opacity.
fn circles(svg: &str, opacity: &str) -> Vec<(f64, f64, f64)> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let circles = document.descendants().filter(|node| node.attribute("opacity") == Some(opacity));
    let circles =
        circles.filter(|node| node.has_tag_name("circle") && node.attribute("fill") != Some("none"));
    let number = |node: &roxmltree::Node<'_, '_>, name| node.attribute(name).unwrap().parse::<f64>().unwrap();
    circles.map(|node| (number(&node, "cx"), number(&node, "cy"), number(&node, "r"))).collect()
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

#[test]
fn boundary_over_one_factor_has_curve_level_and_points() {
    let goal = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.2}});
    let answer = answer(&factors(1), goal, 120);
    let texts = ["gate opening (m)", "probability of jammed", "level 0.2"];
    let drawn = picture("curve", &answer, &texts);
    let found = &answer.answer["finding"]["boundary"];
    let observed = found["observed"].as_array().unwrap();
    let points = circles(&drawn, "0.75");
    let legend = points.iter().filter(|(x, ..)| *x > 660.0).count();
    assert_eq!(
        (points.len(), legend),
        (observed.len() + 2, 2),
        "each point once, and two sizes in the legend"
    );
    // The place of a point follows from its value.
    let low = observed.iter().map(|point| point["values"][0].as_f64().unwrap());
    let values = sorted(low.collect());
    let places = sorted(points.iter().map(|(x, ..)| *x).filter(|x| *x < 660.0).collect());
    let (first, last) = (places[0], places[places.len() - 1]);
    let width = (values[values.len() - 1] - values[0]) / (last - first);
    for (value, place) in values.iter().zip(&places) {
        assert!((value - values[0] - width * (place - first)).abs() < 1.5 * width, "{value} at {place}");
    }
    // More runs make larger points.
    let radii = sorted(points.iter().map(|(.., radius)| *radius).collect());
    assert!(radii[0] < radii[radii.len() - 1], "{radii:?}");
    let crossing = found["crossings"][0]["estimates"][0].as_f64().unwrap();
    assert!(drawn.contains(&format!("crossing at {} m", crate::format::significant(crossing))));
}

#[test]
fn boundary_over_two_factors_is_a_map_with_its_boundary() {
    let goal = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.2}});
    let answer = answer(&factors(2), goal, 180);
    let drawn = picture("map", &answer, &["gate opening (m)", "belt speed (m/s)", "boundary, 0.2"]);
    let document = roxmltree::Document::parse(&drawn).unwrap();
    let boundary = document.descendants().find(|node| node.attribute("stroke-width") == Some("3")).unwrap();
    let places: Vec<(f64, f64)> = boundary
        .attribute("points")
        .unwrap()
        .split_whitespace()
        .filter_map(|pair| pair.split_once(','))
        .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
        .collect();
    assert!(places.len() > 10, "{places:?}");
    // The plot is 860 − 200 wide with margins of 76 and 12: the gate's range is 0.03 to 0.08 m.
    let gate = |x: f64| 0.03 + 0.05 * (x - 76.0) / (660.0 - 12.0 - 76.0);
    for (x, _) in &places {
        // Where a jam has the probability 0.2 at some speed from 0.1 to 1 m/s.
        assert!((0.05..0.072).contains(&gate(*x)), "{}", gate(*x));
    }
    let below = drawn.matches("#D55E00").count();
    assert_eq!(below, 0, "shades are mixed with white");
    let observed = answer.answer["finding"]["boundary"]["observed"].as_array().unwrap();
    assert_eq!(circles(&drawn, "0.3").len(), observed.len() + 2);
}

#[test]
fn boundary_over_three_factors_has_slices() {
    let goal = json!({"boundary": {"of": {"mean": "mean_rate_kg_s"}, "level": 2.0}});
    let answer = answer(&factors(3), goal, 80);
    picture(
        "slices",
        &answer,
        &["boundary, 2 kg/s", "fillet belt static friction 0.2", "fillet belt static friction 0.8"],
    );
}

#[test]
fn estimates_are_shown_as_points_or_rows() {
    let intervals = json!([{"of": {"probability": "jammed"}, "width": 0.4}, {"of": {"mean": "mean_rate_kg_s"}, "width": 0.1}]);
    let goal = json!({"estimate": {"points": [[0.04], [0.055], [0.07]], "intervals": intervals}});
    let labels = ["probability of jammed", "mean rate (kg/s)"];
    picture("points", &answer(&factors(1), goal, 200), &labels);
    let goal = json!({"estimate": {"points": [[0.04, 0.2], [0.07, 0.5]], "intervals": intervals}});
    picture("rows", &answer(&factors(2), goal, 200), &[labels[0], labels[1], "0.07 m, 0.5 m/s"]);
}

#[test]
fn recommendation_has_forecast_and_confirmation() {
    let goal = json!({"optimise": {"objectives": [{"maximise": {"mean": "mean_rate_kg_s"}}],
        "constraints": [{"of": {"probability": "jammed"}, "at_most": 0.2}]}});
    let answer = answer(&factors(2), goal, 160);
    let drawn = picture("optimum", &answer, &["mean rate (kg/s)", "probability of jammed"]);
    let found = &answer.answer["finding"]["optimise"]["recommended"][0]["confirmation"];
    assert_eq!(found["state"], "confirmed");
    assert_eq!(drawn.matches("fill=\"#009E73\"").count(), 2, "both measures are confirmed");
}

#[test]
fn front_has_numbered_points() {
    let goal = json!({"optimise": {"objectives": [{"maximise": {"mean": "mean_rate_kg_s"}},
        {"minimise": {"mean": "curl_angle_deg"}}], "front_points": 3}});
    let answer = answer(&factors(2), goal, 150);
    let drawn = picture(
        "front",
        &answer,
        &["mean rate (kg/s), maximised", "mean curl angle (°), minimised", "1", "2"],
    );
    assert!(drawn.contains("1: gate opening"), "values of the points");
}

#[test]
fn sensitivities_are_shown_as_bars() {
    let of = json!([{"mean": "mean_rate_kg_s"}, {"probability": "jammed"}]);
    let goal = json!({"sensitivity": {"of": of, "width": 0.5}});
    let texts =
        ["share of the variance of the mean rate (kg/s)", "gate opening", "fillet belt static friction"];
    picture("sobol", &answer(&factors(3), goal, 400), &texts);
    let goal = json!({"sensitivity": {"of": of, "width": 0.5, "method": "morris"}});
    picture("morris", &answer(&factors(3), goal, 300), &["belt speed", "μ* of noise alone"]);
}

#[test]
fn calibration_has_samples_numbers_and_curves() {
    let target = |of: &str, mean: f64| json!({"test": "plant", "of": {"mean": of}, "mean": mean, "deviation": 0.05, "n": 4});
    let on_curve = |at: f64, mean: f64| {
        let mut point = target(&format!("discharged_mass_kg@time_s={at}"), mean);
        point["curve"] = json!({"name": "discharged_mass_kg@time_s", "at": at});
        point
    };
    let goal = json!({"calibrate": {"targets": [target("curl_angle_deg", 40.0), on_curve(1.0, 1.5), on_curve(2.0, 3.15)]}});
    let answer = answer(&factors(2), goal, 60);
    let texts = ["gate opening (m)", "plant: curl angle", "plant", "time (s)", "discharged mass (kg)"];
    let drawn = picture("calibration", &answer, &texts);
    let found = &answer.answer["finding"]["calibrate"];
    assert_eq!(circles(&drawn, "0.25").len(), found["samples"].as_array().unwrap().len());
    let orange = circles(&drawn, "1").into_iter().filter(|(.., radius)| *radius == 5.0).count();
    assert_eq!(
        orange, 4,
        "simulated mean of the number, two measured points of the curve, and one in the legend"
    );
    let band = roxmltree::Document::parse(&drawn)
        .unwrap()
        .descendants()
        .filter(|node| node.has_tag_name("polygon"))
        .count();
    assert_eq!(band, 1, "the simulated band of the curve");
}

#[test]
fn study_without_results_has_its_question_alone() {
    let goal = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.2}});
    let mut answer = answer(&factors(1), goal, 40);
    answer.answer = Value::Null;
    answer.study.answer.clear();
    let drawn = answer_svg(&answer).unwrap();
    assert!(drawn.contains("No run has a result yet."));
}

#[test]
fn long_texts_are_broken_at_spaces() {
    assert_eq!(wrapped("one two  three", 8), ["one two", "three"]);
    assert_eq!(wrapped("incomprehensible word", 8), ["incomprehensible", "word"]);
    assert!(wrapped("", 8).is_empty());
}

#[test]
fn levels_are_shown_as_ticks_with_their_names() {
    let walls = json!([{"pointer": "/equipment/side_walls", "levels": ["frictionless", "steel"]}]);
    let goal = json!({"estimate": {
        "points": [["frictionless"], ["steel"]],
        "intervals": [{"of": {"probability": "jammed"}, "width": 0.3}],
    }});
    let drawn = picture("levels", &answer(&walls, goal, 200), &["side walls", "frictionless", "steel"]);
    let places = circles(&drawn, "0.75");
    assert!(places.len() >= 2 && places[1].0 - places[0].0 > 100.0, "a place for each level: {places:?}");
    let mixed = json!([walls[0], {"pointer": "/product/count", "low": 6, "high": 60}]);
    let goal = json!({"optimise": {"objectives": [{"minimise": {"mean": "mean_rate_kg_s"}}]}});
    let answer = answer(&mixed, goal, 60);
    let values = &answer.answer["finding"]["optimise"]["recommended"][0]["values"];
    let name = format!("{}, {}", values[0].as_str().unwrap(), values[1].as_f64().unwrap());
    picture("mixed", &answer, &[&name]);
}

#[test]
fn whole_numbers_have_places_in_the_middle_of_their_cells() {
    let factors = json!([{"pointer": "/product/count", "low": 6, "high": 8}, {"pointer": SPEED, "low": 0.1, "high": 1.0}]);
    let goal = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.5}});
    picture("whole", &answer(&factors, goal, 80), &["count", "6", "7", "8"]);
}
