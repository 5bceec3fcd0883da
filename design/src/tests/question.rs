//! Tests of questions: faults by JSON pointer, all at once.

use serde_json::{Value, json};

use crate::Question;

fn question() -> Value {
    json!({
        "factors": [
            { "name": "/gate/opening_m", "low": 0.03, "high": 0.09 },
            { "name": "/belt/friction", "low": 0.1, "high": 1.0, "scale": "log" },
        ],
        "goal": { "estimate": {
            "points": [[0.05, 0.5]],
            "intervals": [{ "of": { "probability": "jammed" }, "width": 0.1 }],
        } },
        "budget": { "max_runs": 400 },
    })
}

fn pointers(document: &Value) -> Vec<String> {
    Question::read(document).unwrap_err().into_iter().map(|fault| fault.pointer).collect()
}

#[test]
fn a_question_is_read_and_written() {
    let read = Question::read(&question()).unwrap();
    assert_eq!((read.budget.max_replicates, read.budget.max_failures), (1000, 3));
    assert_eq!(Question::read(&serde_json::to_value(&read).unwrap()).unwrap(), read);
}

#[test]
fn unknown_fields_and_wrong_types_are_refused_by_pointer() {
    let mut unknown = question();
    unknown["goal"]["estimate"]["colour"] = json!("red");
    assert_eq!(pointers(&unknown), ["/goal/estimate/colour"]);
    let mut wrong = question();
    wrong["factors"][1]["low"] = json!("little");
    assert_eq!(pointers(&wrong), ["/factors/1/low"]);
}

#[test]
fn all_faults_of_a_question_are_reported_at_once() {
    let mut document = question();
    document["factors"][0]["high"] = json!(0.02);
    document["factors"][1]["low"] = json!(0.0);
    document["factors"][1]["name"] = json!("/gate/opening_m");
    document["goal"]["estimate"]["points"] = json!([[0.05], [0.05, 3.0]]);
    document["goal"]["estimate"]["intervals"][0]["width"] = json!(0);
    document["budget"]["max_runs"] = json!(0);
    assert_eq!(
        pointers(&document),
        [
            "/factors/0/high",
            "/factors/1/low",
            "/factors/1/name",
            "/budget/max_runs",
            "/goal/estimate/points/0",
            "/goal/estimate/points/0/0",
            "/goal/estimate/points/1/0",
            "/goal/estimate/points/1/1",
            "/goal/estimate/intervals/0/width",
        ]
    );
}
