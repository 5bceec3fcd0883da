//! Differences between two design points, with intervals that use their common seeds.

use roost_api::table::{PairingGain, ResponseDifference, TrialRow};

use super::replicates::{ReplicateTables, ends, gain};

/// The difference of every response that both points have, second less first, and what pairing did to their intervals. `runs_per_sample` are
/// the replicates in a row that have the same parameters, if these come from a posterior.
pub(crate) fn differences(
    from: &[TrialRow],
    to: &[TrialRow],
    runs_per_sample: Option<u32>,
) -> (Vec<ResponseDifference>, PairingGain) {
    // Two points are few enough for one pass.
    let mut replicates = ReplicateTables::new(usize::MAX, runs_per_sample);
    replicates.add(from);
    replicates.add(to);
    let both = replicates.finish_pass().0.filter(|response| response.points.len() == 2);
    let mut differences: Vec<ResponseDifference> = both
        .map(|response| {
            let contrast = response.table.contrast(&[-1.0, 1.0], response.kind);
            let counts: Vec<u64> = response.table.points().map(|values| values.len() as u64).collect();
            let (means, (low_95, high_95)) = (response.table.means(), ends(contrast.interval));
            ResponseDifference {
                pairing: response.pairing(),
                response: response.name,
                from_n: counts[0],
                from_mean: means[0],
                to_n: counts[1],
                to_mean: means[1],
                difference: contrast.value,
                low_95,
                high_95,
                width_ratio: contrast.width_ratio,
            }
        })
        .collect();
    differences.sort_by(|one, other| one.response.cmp(&other.response));
    let gain = gain(differences.iter().filter_map(|of| of.width_ratio).collect());
    (differences, gain)
}
