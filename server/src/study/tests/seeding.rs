//! Seeds that points of the sweeps that a study begins with have in common.

use roost_api::ids::SweepId;

use super::{boundary, study, sweep_run};
use crate::study::{Copied, SweepRun};

#[test]
fn seeds_that_points_of_different_sweeps_share_are_stated() {
    let mut study = study(boundary());
    let (mut copied, mut copies) = (Copied::default(), Vec::new());
    // The seeds of each sweep are that of its base plus the replicate.
    for (name, gate, first_seed) in [("narrow", 0.04, 7), ("wide", 0.05, 7), ("other seeds", 0.06, 100)] {
        let runs: Vec<SweepRun> =
            (first_seed..first_seed + 20).map(|seed| sweep_run(gate, 0.5, seed, &|_| {})).collect();
        let (counts, more) = study.copy((SweepId::new(), name.to_owned(), 0), &runs, &mut copied);
        study.seeding.push(counts);
        copies.extend(more);
        // A single point shares no seed.
        assert_eq!(study.seeding[0].shares_seeds, study.seeding.len() > 1, "{name}");
    }
    let counts: Vec<_> = study.seeding.iter().map(|it| (it.copied, it.repeated, it.shares_seeds)).collect();
    assert_eq!(counts, [(20, 0, true), (20, 0, true), (20, 0, false)]);
    let sentences = study.decide(&[], &copies, 0).unwrap().sentences;
    let warning = sentences.iter().find(|sentence| sentence.contains("have seeds in common")).unwrap();
    assert!(warning.contains("`narrow`") && warning.contains("`wide`"), "{warning}");
    assert!(!warning.contains("`other seeds`"), "{warning}");
}
