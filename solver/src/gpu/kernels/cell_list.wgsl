// The cell list: twin of cpu/cell_list.rs. Every sub-particle joins the chain of its cell. Chains are
// unordered; their readers sort.

// Cells are numbered along x first, and the list wraps around at its edges.
fn cell_of(scene: Scene, x: vec3<i32>) -> vec3<u32> {
    // Relative to the lowest possible position, so that no cell index is negative.
    return (bitcast<vec3<u32>>(x) ^ vec3(0x80000000u)) / scene.cell;
}

fn head_index(scene: Scene, cell: vec3<u32>) -> u32 {
    let at = cell & scene.mask;
    return scene.first_cell + at.x + (scene.mask.x + 1u) * (at.y + (scene.mask.y + 1u) * at.z);
}

@compute @workgroup_size(GROUP_SIZE)
fn cell_list(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation_index(group, groups, local);
    if i >= dispatch.count {
        return;
    }
    let scene = scenes[scene_of[i]];
    let head = head_index(scene, cell_of(scene, particles[i].position));
    chain[i] = atomicExchange(&heads[head], i + 1u);
}
