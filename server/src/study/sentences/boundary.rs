//! Where a measure has a level, in sentences.

use roost_api::quantity::Quantity;
use roost_design::goals::{BoundaryAnswer, Crossing, MapPoint, Place, Side};
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

/// Maximum number of stretches in a sentence.
const MAX_STRETCHES: usize = 3;

/// The stretches of a single factor that are below the level with 95 % confidence, as a decision needs them.
fn safe_side(finding: &BoundaryAnswer, quantity: &Quantity, what: &str, level: &str) -> Option<String> {
    let below = stretches_below(&finding.map);
    let words = |(from, to): &(f64, f64)| match from == to {
        true => number(quantity, *from),
        false => format!("from {}", range(quantity, *from, *to)),
    };
    let below: Vec<String> = below.iter().map(words).collect();
    (1..=MAX_STRETCHES).contains(&below.len()).then(|| {
        format!(
            "{} is below {level} for {} {}, with 95 % confidence.",
            capital(what),
            quantity.name,
            list(&below)
        )
    })
}

/// Both ends of each stretch that is below the level, on the map of a single factor. A stretch may be a single point.
fn stretches_below(map: &[MapPoint]) -> Vec<(f64, f64)> {
    let stretches = map.chunk_by(|point, next| point.side == next.side);
    let below = stretches.filter(|points| points[0].side == Side::Below);
    below.map(|points| (points[0].values[0], points[points.len() - 1].values[0])).collect()
}

/// Percent of the map on one side.
fn share(finding: &BoundaryAnswer, is_below: bool) -> String {
    let side = if is_below { Side::Below } else { Side::Above };
    let count = finding.map.iter().filter(|point| point.side == side).count();
    digits((100.0 * count as f64 / finding.map.len().max(1) as f64).round())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_below_the_level_end_at_their_first_and_last_points() {
        use Side::{Above, Band, Below};
        let map = |sides: &[Side]| -> Vec<MapPoint> {
            let point = |(index, side): (usize, &Side)| MapPoint {
                values: vec![index as f64],
                side: *side,
                estimate: 0.0,
                low: 0.0,
                high: 0.0,
            };
            sides.iter().enumerate().map(point).collect()
        };
        let sides = [Above, Band, Below, Below, Below, Band, Below, Band, Below, Below];
        assert_eq!(stretches_below(&map(&sides)), [(2.0, 4.0), (6.0, 6.0), (8.0, 9.0)]);
        assert_eq!(stretches_below(&map(&[Below, Below])), [(0.0, 1.0)]);
        assert_eq!(stretches_below(&map(&[Above, Band])), []);
    }
}
