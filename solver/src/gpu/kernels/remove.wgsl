// Removal of sub-particles from a run that is alone in the batch: twin of cpu/neighbour_list.rs. `chain` holds the new index of
// each sub-particle, or NONE. The new rows have the stride of the sub-particles that stay.

@compute @workgroup_size(GROUP_SIZE)
fn remove(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation_index(group, groups, local);
    if i >= dispatch.count || chain[i] == NONE {
        return;
    }
    let scene = scenes[0];
    let known = counts[i];
    var count = 0u;
    for (var k = 0u; k < known.pairs; k++) {
        let at = i + k * scene.count;
        let pair = pairs[at];
        let other = chain[pair.other];
        if other != NONE {
            let to = chain[i] + count * dispatch.kept;
            new_pairs[to] = Pair(pair.bond, other, pair.xi, pair.state);
            if has_moments(scene) {
                new_moments[to] = moments[at];
            }
            count++;
        }
    }
    for (var k = 0u; k < known.walls; k++) {
        new_walls[chain[i] + k * dispatch.kept] = walls[i + k * scene.count];
    }
    new_counts[chain[i]] = Count(count, known.walls);
}
