//! The finding of a calibration in sentences.

use roost_api::quantity::Quantity;
use roost_design::goals::CalibrateAnswer;
use roost_design::goals::calibrate::{Interval, Narrowing, TEST, TargetAgreement};
use roost_design::{Factor, Question};

use super::{ASSUMPTIONS, capital};
use crate::study::words::{digits, list, number, range, value};

/// Remaining share of a prior's deviation from which on the tests say little of a parameter.
const LITTLE: f64 = 0.8;
/// R̂ above which samples are rough.
const ROUGH: f64 = 1.05;

/// The question in words.
pub(super) fn question(question: &Question, measurements: &str) -> String {
    let parameters = question.factors.iter().filter(|factor| factor.name != TEST);
    let parameters = parameters.map(|factor| {
        let quantity = Quantity::of_field(&factor.name);
        format!("{} from {}", quantity.name, range(&quantity, factor.low, factor.high))
    });
    let parameters = list(&parameters.collect::<Vec<_>>());
    format!("Which {parameters} agree with the measurements \"{measurements}\"?")
}

/// The finding in words.
pub(super) fn sentences(finding: &CalibrateAnswer) -> Vec<String> {
    if finding.parameters.is_empty() {
        return vec!["Too few runs have ended to compare them with the measurements.".to_owned()];
    }
    let mut sentences: Vec<String> = Vec::new();
    let name = |parameter: &str| Quantity::of_field(parameter).name;
    for found in &finding.parameters {
        let quantity = Quantity::of_field(&found.parameter);
        let Interval { mean, low, high } = found.estimate;
        let percent = digits((100.0 * found.remaining).round().min(100.0));
        let little = if found.remaining > LITTLE { " The tests say little of it." } else { "" };
        sentences.push(format!(
            "{} is {} (95 %: {}), with {percent} % of the uncertainty before the tests.{little}",
            capital(&quantity.name),
            number(&quantity, mean),
            range(&quantity, low, high),
        ));
    }
    let best = finding.parameters.iter().map(|found| {
        let quantity = Quantity::of_field(&found.parameter);
        format!("{} {}", quantity.name, number(&quantity, found.best))
    });
    sentences.push(format!("The most probable set is {}.", list(&best.collect::<Vec<_>>())));
    for pair in &finding.pairs {
        let [one, other] = [&pair.parameters[0], &pair.parameters[1]].map(|parameter| name(parameter));
        let direction = if pair.correlation > 0.0 { "larger" } else { "smaller" };
        sentences.push(format!(
            "The tests cannot tell {one} and {other} apart: a larger {one} agrees as well with a {direction} {other}."
        ));
    }
    sentences.extend(finding.further.iter().map(narrowing));
    sentences.extend(agreement(&finding.targets));
    if let Some(discrepancy) = finding.discrepancy {
        let percent = |share: f64| digits((1000.0 * share).round() / 10.0);
        let [mean, high] = [discrepancy.mean, discrepancy.high].map(percent);
        sentences.push(format!(
            "The discrepancy of the model is {mean} % of the measured numbers, and at most {high} % (95 %)."
        ));
    }
    if let Some(share) = finding.emulator_share {
        let percent = digits((100.0 * share).round());
        sentences.push(format!(
            "What the emulators do not know is at most {percent} % of the variance of a comparison."
        ));
    }
    if let Some(r_hat) = finding.r_hat.filter(|r_hat| *r_hat > ROUGH) {
        let r_hat = digits(r_hat);
        sentences.push(format!("The intervals are rough: the samples do not agree yet (R̂ {r_hat})."));
    }
    sentences
}

fn narrowing(further: &Narrowing) -> String {
    let names: Vec<String> =
        further.parameters.iter().map(|parameter| Quantity::of_field(parameter).name).collect();
    let test = further.test.as_ref().map_or(String::new(), |test| format!(" in the test \"{test}\""));
    let percent = digits((100.0 * further.leaves).round());
    format!(
        "A measurement of `{}`{test} to 5 % would leave {percent} % of what is open about {}.",
        further.response,
        list(&names)
    )
}

/// Agreement of simulated and measured numbers.
fn agreement(targets: &[TargetAgreement]) -> Vec<String> {
    let mut sentences = Vec::new();
    let contradicted: Vec<&TargetAgreement> = targets.iter().filter(|of| of.is_contradicted()).collect();
    for of in &contradicted {
        let (target, simulated) = (&of.target, of.simulated.map_or(f64::NAN, |simulated| simulated.mean));
        sentences.push(format!(
            "No set of parameters agrees with `{}` of the test \"{}\": simulated {}, measured {}, {} standard deviations apart.",
            target.of.response(),
            target.test,
            value(&target.of, simulated),
            value(&target.of, target.mean),
            digits((10.0 * of.distance.unwrap_or_default().abs()).round() / 10.0),
        ));
    }
    let missing: Vec<String> = targets
        .iter()
        .filter(|of| of.simulated.is_none())
        .map(|of| format!("`{}` of the test \"{}\"", of.target.of.response(), of.target.test))
        .collect();
    if !missing.is_empty() {
        sentences.push(format!("Too few runs gave {}, which was not compared.", list(&missing)));
    }
    let agreeing = targets.len() - contradicted.len() - missing.len();
    if agreeing > 0 && contradicted.is_empty() {
        sentences.push(match agreeing {
            1 => "The measured number does not contradict the simulation.".to_owned(),
            _ => format!("None of {agreeing} measured numbers contradicts the simulation."),
        });
    }
    sentences
}

/// The assumptions of the answer.
pub(super) fn assumptions(question: &Question) -> String {
    let names = |factor: &Factor| Quantity::of_field(&factor.name).name;
    let parameters = question.factors.iter().filter(|factor| factor.name != TEST).map(names);
    format!(
        "{ASSUMPTIONS} the scenarios of the tests, and for no {} outside the ranges.",
        parameters.collect::<Vec<_>>().join(" or ")
    )
}
