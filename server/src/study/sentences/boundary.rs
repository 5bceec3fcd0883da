//! Where a measure has a level, in sentences.

use roost_api::quantity::Quantity;
use roost_design::goals::{BoundaryAnswer, Crossing, Place};
use roost_design::{Factor, Goal};

use super::capital;
use crate::study::Study;
use crate::study::words::{digits, list, measure, number, range, value};

/// Where the boundary is, and how certain that is.
pub(super) fn sentences(study: &Study, finding: &BoundaryAnswer) -> Vec<String> {
    let Goal::Boundary(goal) = &study.question.goal else { return Vec::new() };
    let what = measure(&goal.of);
    let level = value(&goal.of, goal.level);
    let mut sentences = Vec::new();
    match finding.place {
        Place::NowhereAllBelow => {
            sentences.push(format!(
                "Nowhere in the range: {what} is below {level} everywhere, with 95 % confidence."
            ));
        }
        Place::NowhereAllAbove => {
            sentences.push(format!(
                "Nowhere in the range: {what} is above {level} everywhere, with 95 % confidence."
            ));
        }
        Place::Inside => match study.question.factors.as_slice() {
            [factor] => {
                let quantity = Quantity::of_field(&factor.name);
                sentences.extend(finding.crossings.iter().map(|at| crossing(at, factor, &what, &level)));
                sentences.extend(safe_side(finding, &quantity, &what, &level));
            }
            factors => {
                let names: Vec<String> =
                    factors.iter().map(|factor| Quantity::of_field(&factor.name).name).collect();
                sentences.push(format!(
                    "The boundary lies inside the range: {what} is below {level} in {} % of it and above in {} %, with 95 % confidence.",
                    share(finding, true), share(finding, false)
                ));
                sentences.push(format!("The map over {} shows where.", list(&names)));
            }
        },
        Place::Unknown => sentences.push(format!("It is not known yet where {what} is {level}.")),
    }
    if let Some(misclassified) = finding.misclassified {
        sentences.push(format!(
            "An expected {} % of the range is on the wrong side of the estimated boundary; {} % was asked.",
            digits(100.0 * misclassified),
            digits(100.0 * finding.asked)
        ));
    }
    sentences
}

/// A stretch of a single factor in which the level is, or may be, crossed.
fn crossing(crossing: &Crossing, factor: &Factor, what: &str, level: &str) -> String {
    let quantity = &Quantity::of_field(&factor.name);
    let (name, range) = (&quantity.name, range(quantity, crossing.low, crossing.high));
    if factor.is_whole && crossing.is_certain {
        let ends = format!("between {} and {}", digits(crossing.low), number(quantity, crossing.high));
        return match crossing.estimates.as_slice() {
            [only] if crossing.high - crossing.low > 1.0 => {
                let nearest = number(quantity, only.round());
                format!(
                    "{} crosses {level} at a {name} {ends}, with 95 % confidence, most probably near {nearest}.",
                    capital(what)
                )
            }
            _ => format!("{} crosses {level} at a {name} {ends}, with 95 % confidence.", capital(what)),
        };
    }
    if !crossing.is_certain {
        return format!("{} may be {level} at a {name} of {range} too: more runs would tell.", capital(what));
    }
    match crossing.estimates.as_slice() {
        [only] => {
            let middle = number(quantity, *only);
            format!("{} is {level} at a {name} of {middle} ({range} with 95 % confidence).", capital(what))
        }
        _ => format!("{} is {level} at a {name} of {range}, with 95 % confidence.", capital(what)),
    }
}

/// The stretch of a single factor that is below the level with 95 % confidence, as a decision needs it.
fn safe_side(finding: &BoundaryAnswer, quantity: &Quantity, what: &str, level: &str) -> Option<String> {
    use roost_design::goals::Side;
    let below: Vec<f64> =
        finding.map.iter().filter(|point| point.side == Side::Below).map(|point| point.values[0]).collect();
    let (first, last) = (below.first()?, below.last()?);
    let is_one_stretch = {
        let sides: Vec<bool> = finding.map.iter().map(|point| point.side == Side::Below).collect();
        sides.windows(2).filter(|pair| !pair[0] && pair[1]).count() + usize::from(sides[0]) == 1
    };
    is_one_stretch.then(|| {
        format!(
            "{} is below {level} for {} from {}, with 95 % confidence.",
            capital(what),
            quantity.name,
            range(quantity, *first, *last)
        )
    })
}

/// Percent of the map on one side.
fn share(finding: &BoundaryAnswer, is_below: bool) -> String {
    use roost_design::goals::Side;
    let side = if is_below { Side::Below } else { Side::Above };
    let count = finding.map.iter().filter(|point| point.side == side).count();
    digits((100.0 * count as f64 / finding.map.len().max(1) as f64).round())
}
