//! Forecast of the number of runs of a study, before it has any.
//!
//! The budget bounds the number from above. From below it is bounded by the best case, in which all runs agree:
//!
//! | goal | best case |
//! |---|---|
//! | `estimate` | at each point the fewest runs whose interval can be as narrow as asked: all responses equal, or 5 values of a mean |
//! | `boundary` of a probability p* | the first design, and ln 0.05 / ln(1 − min(p*, 1 − p*)) runs: fewer cannot show a side of p* |
//! | `boundary` of a mean | the first design |
//! | `optimise` | the smallest first design, and a confirmation that succeeds at its first look |
//! | `sensitivity` | the rows of the first look |
//! | `calibrate` | the first design of each test |
//!
//! Zero jams in n runs exclude a probability p with 95 % confidence if (1 − p)ⁿ ≤ 0.05: 59 runs for p = 0.05.

use crate::goals::{Goal, boundary, calibrate, optimise, sensitivity};
use crate::intervals::{CONFIDENCE, MIN_MEAN_RUNS, confidence_sequence};
use crate::measure::Measure;
use crate::question::Question;

/// Maximum number of runs of one point that is considered.
const MAX_RUNS: usize = 1 << 24;

/// The number of runs of a question in the best case: with fewer its rule cannot end the study.
pub fn least_runs(question: &Question) -> usize {
    match &question.goal {
        Goal::Estimate(goal) => {
            let of_point =
                goal.intervals.iter().map(|interval| narrow_runs(&interval.of, interval.width)).max();
            goal.points.len().saturating_mul(of_point.unwrap_or(0))
        }
        Goal::Boundary(goal) => {
            let first = boundary::first_points(&question.factors, &question.budget);
            match goal.of {
                Measure::Probability(_) => first.max(side_runs(goal.level)),
                Measure::Mean(_) => first,
            }
        }
        Goal::Optimise(goal) => optimise::least_runs(goal, question.factors.len()),
        Goal::Sensitivity(goal) => sensitivity::least_runs(goal, &question.factors, &question.budget),
        Goal::Calibrate(_) => calibrate::least_runs(&question.factors, &question.budget),
    }
}

/// Number of equal responses after which one side of a probability is shown with 95 % confidence.
pub fn side_runs(level: f64) -> usize {
    let rare = level.min(1.0 - level);
    // Rounding must not ask for one run more: the quotient of logarithms can lie above a whole number by its last bit.
    let runs = ((1.0 - CONFIDENCE).ln() / (-rare).ln_1p() - 1e-9).ceil();
    if runs.is_finite() { runs.max(1.0) as usize } else { MAX_RUNS }
}

/// The fewest runs at a point whose interval can be as narrow as `width`.
fn narrow_runs(of: &Measure, width: f64) -> usize {
    if matches!(of, Measure::Mean(_)) {
        return MIN_MEAN_RUNS;
    }
    let is_narrow = |runs: usize| {
        let (low, high) = confidence_sequence(0.0, runs as f64, CONFIDENCE);
        high - low <= width
    };
    let mut enough = 1;
    while enough < MAX_RUNS && !is_narrow(enough) {
        enough *= 2;
    }
    let mut below = enough / 2;
    while enough > below + 1 {
        let middle = below.midpoint(enough);
        *(if is_narrow(middle) { &mut enough } else { &mut below }) = middle;
    }
    enough
}

/// A budget that is too small for the asked confidence, in words; none where the best case fits.
pub fn shortage(question: &Question) -> Option<String> {
    let (least, most) = (least_runs(question), question.budget.max_runs);
    let at_a_point = match &question.goal {
        Goal::Estimate(goal) => {
            goal.intervals.iter().map(|interval| narrow_runs(&interval.of, interval.width)).max().unwrap_or(0)
        }
        _ => 0,
    };
    if least > most {
        return Some(format!("the best case needs {least} runs, and the budget is {most}"));
    }
    let replicates = question.budget.max_replicates;
    (at_a_point > replicates).then(|| {
        format!("the best case needs {at_a_point} runs at each point, and max_replicates is {replicates}")
    })
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn question(goal: Value, max_runs: usize) -> Question {
        let factors = json!([{"name": "x", "low": 0.0, "high": 1.0}, {"name": "y", "low": 0.0, "high": 1.0}]);
        let document = json!({"factors": factors, "goal": goal, "budget": {"max_runs": max_runs}});
        Question::read(&document).unwrap()
    }

    fn boundary(level: f64, max_runs: usize) -> Question {
        question(json!({"boundary": {"of": {"probability": "jammed"}, "level": level}}), max_runs)
    }

    #[test]
    fn a_rare_jam_needs_59_runs_without_one() {
        for (level, runs) in [(0.05, 59), (0.95, 59), (0.01, 299), (0.5, 5), (0.1, 29)] {
            assert_eq!(side_runs(level), runs, "{level}");
            let left = |runs: i32| (1.0 - level.min(1.0 - level)).powi(runs);
            assert!(left(runs as i32) <= 0.05 && left(runs as i32 - 1) > 0.05, "{level}");
        }
        assert_eq!(least_runs(&boundary(0.05, 300)), 59);
        assert_eq!(least_runs(&boundary(0.5, 300)), 16, "the first design has more");
        assert_eq!(
            shortage(&boundary(0.05, 58)).unwrap(),
            "the best case needs 59 runs, and the budget is 58"
        );
        assert_eq!(shortage(&boundary(0.05, 59)), None);
    }

    #[test]
    fn estimates_need_runs_at_every_point() {
        let goal = |of: Value, width: f64| json!({"estimate": {"points": [[0.1, 0.1], [0.2, 0.2], [0.3, 0.3]], "intervals": [{"of": of, "width": width}]}});
        let mean = question(goal(json!({"mean": "rate"}), 0.1), 100);
        assert_eq!(least_runs(&mean), 15);
        let share = question(goal(json!({"probability": "jammed"}), 0.2), 100);
        let each = least_runs(&share) / 3;
        let width = |runs: usize| {
            let (low, high) = confidence_sequence(0.0, runs as f64, CONFIDENCE);
            high - low
        };
        assert!(width(each) <= 0.2 && width(each - 1) > 0.2, "{each} runs");
        let mut narrow = share.clone();
        narrow.budget.max_replicates = each - 1;
        assert!(shortage(&narrow).unwrap().contains("at each point"));
    }

    #[test]
    fn budget_below_the_forecast_minimum_is_a_fault() {
        for goal in [
            json!({"optimise": {"objectives": [{"maximise": {"mean": "rate"}}],
                                "constraints": [{"of": {"probability": "jammed"}, "at_most": 0.05}]}}),
            json!({"optimise": {"objectives": [{"maximise": {"mean": "rate"}}]}}),
            json!({"sensitivity": {"of": [{"mean": "rate"}], "width": 0.2}}),
        ] {
            let asked = question(goal.clone(), 100_000);
            let least = least_runs(&asked);
            assert!(least > 5, "{goal}");
            let mut tight = asked;
            tight.budget.max_runs = least - 1;
            assert!(!tight.faults().is_empty(), "{goal} with {} runs", least - 1);
        }
    }
}
