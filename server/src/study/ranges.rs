//! Wider ranges of a study. Runs keep their values, and the evidence maps them into the new ranges.

use roost_api::Fault;
use roost_api::design::Factor;
use roost_api::study::{RangeChange, StudySpec};
use roost_solver::mesh::Meshes;
use serde_json::{Value, json};

use super::{Present, Study, read};
use crate::document::{fault, is_within};
use crate::sweep::SweepLimits;

/// Lowest and highest value by factor; 0 and 0 for one with levels.
pub(crate) type Ranges = Vec<(f64, f64)>;

/// The ranges of a document.
pub(super) fn ranges(factors: &[Factor]) -> Ranges {
    let ends = |factor: &Factor| (factor.low.unwrap_or_default(), factor.high.unwrap_or_default());
    factors.iter().map(ends).collect()
}

/// A document with other ranges.
pub(crate) fn with_ranges(mut spec: StudySpec, ranges: &[(f64, f64)]) -> StudySpec {
    for (factor, (low, high)) in
        spec.factors.iter_mut().zip(ranges).filter(|(factor, _)| factor.levels.is_none())
    {
        (factor.low, factor.high) = (Some(*low), Some(*high));
    }
    spec
}

/// The ranges of a study after a change with the study that they make, or every fault of the change. Ranges that would stay as they are
/// give none.
pub(crate) fn widen(
    present: Present,
    change: &RangeChange,
    meshes: &Meshes,
    limits: SweepLimits,
) -> Result<Option<(Ranges, Study)>, Vec<Fault>> {
    let before = present.spec();
    let names: Vec<&str> = before.factors.iter().map(Factor::name).collect();
    let mut wider = ranges(&before.factors);
    let mut faults = Vec::new();
    let mut entries: Vec<Option<usize>> = vec![None; names.len()];
    for (entry, range) in change.ranges.iter().enumerate() {
        let at = format!("/ranges/{entry}");
        let Some(factor) = names.iter().position(|name| *name == range.pointer) else {
            let pointer = json!(range.pointer);
            faults.push(fault(
                &format!("{at}/pointer"),
                pointer,
                "no factor of the study",
                &names.join(", "),
            ));
            continue;
        };
        if entries[factor].replace(entry).is_some() {
            let pointer = json!(range.pointer);
            faults.push(fault(&format!("{at}/pointer"), pointer, "the factor is listed twice", "once"));
        }
        if before.factors[factor].levels.is_some() {
            let detail = "the factor has levels and no range";
            faults.push(fault(
                &format!("{at}/pointer"),
                json!(range.pointer),
                detail,
                "a factor with a range",
            ));
            continue;
        }
        let (low, high) = &mut wider[factor];
        let detail = "a range can only grow, since its runs are kept";
        match range.low {
            Some(new) if new > *low => {
                faults.push(fault(&format!("{at}/low"), json!(new), detail, &format!("at most {low}")));
            }
            new => *low = new.unwrap_or(*low),
        }
        match range.high {
            Some(new) if new < *high => {
                faults.push(fault(&format!("{at}/high"), json!(new), detail, &format!("at least {high}")));
            }
            new => *high = new.unwrap_or(*high),
        }
    }
    let is_same = wider == ranges(&before.factors);
    // The scenarios at the new corners must be valid, and the question must suit the ranges.
    let document: Value = json!(with_ranges(before.clone(), &wider));
    if let Err(found) = read(document, meshes, limits) {
        faults.extend(found.into_iter().map(|fault| at_entry(fault, &entries)));
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    if is_same {
        return Ok(None);
    }
    let study = Study::stored(Present { ranges: Some(wider.clone()), ..present })?;
    Ok(Some((wider, study)))
}

/// Moves a fault at an end of a factor's range to the entry of the change that names it.
fn at_entry(found: Fault, entries: &[Option<usize>]) -> Fault {
    let entry = entries.iter().enumerate().find_map(|(factor, entry)| {
        let place = format!("/factors/{factor}");
        let rest = is_within(&found.pointer, &place).then(|| found.pointer[place.len()..].to_owned())?;
        entry.map(|entry| format!("/ranges/{entry}{rest}"))
    });
    Fault { pointer: entry.unwrap_or_else(|| found.pointer.clone()), ..found }
}
