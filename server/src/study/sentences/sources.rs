//! Sentences about runs that are no jobs of the study.

use roost_api::study::SeedingSweep;

use super::super::trials::Known;
use super::super::words::list;
use super::Study;

/// The runs of sweeps that the study began with: those that it uses, and those left out with the reasons. Then the runs of clients.
pub(super) fn sentences(study: &Study, known: &Known) -> Vec<String> {
    let mut sentences = Vec::new();
    for seeding in &study.seeding {
        let copies = known.copies.get(&seeding.sweep).copied().unwrap_or_default();
        let name = title(seeding);
        sentences.push(format!("It uses {} runs of {name}, which its budget does not count.", copies.used));
        let left_out = left_out(seeding, copies.outside);
        if !left_out.is_empty() {
            sentences.push(format!("Left out of this sweep: {}.", list(&left_out)));
        }
    }
    if known.told > 0 {
        let runs = if known.told == 1 { "run" } else { "runs" };
        sentences.push(format!(
            "It uses {} {runs} at points of clients, which its budget does not count.",
            known.told
        ));
    }
    sentences
}

/// The assumption of the answer about seeds that points have in common.
pub(super) fn assumption(study: &Study) -> Option<String> {
    let shared: Vec<String> =
        study.seeding.iter().filter(|seeding| seeding.shares_seeds).map(title).collect();
    (!shared.is_empty()).then(|| {
        format!(
            "Points of {} have seeds in common: intervals take their runs for independent, and may be too narrow.",
            list(&shared)
        )
    })
}

fn title(seeding: &SeedingSweep) -> String {
    format!("the sweep `{}` ({})", seeding.name, seeding.sweep)
}

/// The runs of a sweep that are left out, by reason: `20 runs outside the ranges`.
pub(crate) fn left_out(seeding: &SeedingSweep, outside: u64) -> Vec<String> {
    let difference = match &seeding.first_difference {
        Some(pointer) => format!("of other scenarios (the first differs in `{pointer}`)"),
        None => "of other scenarios".to_owned(),
    };
    let levels = match &seeding.first_other_level {
        Some(level) => format!("at levels that their factors lack (the first is `{level}`)"),
        None => "at levels that their factors lack".to_owned(),
    };
    let reasons = [
        (outside, "outside the ranges"),
        (seeding.other_scenarios, &difference),
        (seeding.other_levels, &levels),
        (seeding.other_revisions, "of other solver revisions"),
        (seeding.without_result, "without a result"),
        (seeding.repeated, "that repeat another"),
    ];
    let counted = reasons.into_iter().filter(|(runs, _)| *runs > 0);
    counted
        .map(|(runs, reason)| format!("{runs} {} {reason}", if runs == 1 { "run" } else { "runs" }))
        .collect()
}
