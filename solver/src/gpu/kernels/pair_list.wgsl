// Neighbour lists with histories: twin of cpu/neighbour_list.rs. Rows are sorted by index. Histories of bonds and contacts are
// carried over from the old rows. LANES invocations share the row of a sub-particle: one alone would wait for memory most of the
// time.

// Sub-particles of a workgroup.
const ROWS: u32 = GROUP_SIZE / LANES;

// Neighbours of the sub-particles of a workgroup, in any order, and their numbers, which may exceed MAX_NEIGHBOURS.
var<workgroup> found: array<array<u32, MAX_NEIGHBOURS>, ROWS>;
var<workgroup> found_counts: array<atomic<u32>, ROWS>;
// How many of them were found twice.
var<workgroup> double_counts: array<atomic<u32>, ROWS>;

fn add_found(r: u32, other: u32) {
    let at = atomicAdd(&found_counts[r], 1u);
    if at < MAX_NEIGHBOURS {
        found[r][at] = other;
    }
}

fn is_found(r: u32, count: u32, other: u32) -> bool {
    for (var k = 0u; k < count; k++) {
        if found[r][k] == other {
            return true;
        }
    }
    return false;
}

// Number of neighbours below `other`: its place in the sorted row.
fn place_of(r: u32, count: u32, other: u32) -> u32 {
    var place = 0u;
    for (var k = 0u; k < count; k++) {
        place += select(0u, 1u, found[r][k] < other);
    }
    return place;
}

// Finds the neighbours of sub-particle `i` in cell `k` of the 27 around `x`: its position, or a periodic image of it.
fn find_in_cell(scene: Scene, i: u32, x: vec3<i32>, k: u32, r: u32) {
    let me = particles[i];
    let around = vec3(k % 3u, k / 3u % 3u, k / 9u);
    var next = atomicLoad(&heads[head_index(scene, cell_of(scene, x) - vec3(1u) + around)]);
    while next != 0u {
        let other = next - 1u;
        next = chain[other];
        let d = between(scene.unit_m, scene.period_y, me.position, particles[other].position);
        let cutoff = select(scene.cutoff, scene.body_cutoff, particles[other].body != me.body);
        if other != i && dot3(d, d) <= cutoff * cutoff {
            add_found(r, other - scene.first);
        }
    }
}

fn find_near(scene: Scene, i: u32, lane: u32, r: u32) {
    let x = particles[i].position;
    let images = select(1u, 3u, scene.period_y != 0);
    for (var k = lane; k < 27u * images; k += LANES) {
        let image = vec3(0, scene.period_y * (i32(k / 27u + 1u) % 3 - 1), 0);
        find_in_cell(scene, i, x + image, k % 27u, r);
    }
}

@compute @workgroup_size(GROUP_SIZE)
fn pair_list(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let r = local / LANES;
    let lane = local % LANES;
    let i = (group.y * groups.x + group.x) * ROWS + r;
    let exists = i < dispatch.count;
    let run = scene_of[min(i, dispatch.count - 1u)];
    let scene = scenes[run];
    let builds = exists && !has_ended(scene, run);
    let base = row(scene, dispatch.pair_capacity, i);
    let moments_base = moment_row(scene, i);
    var known = 0u;
    if exists {
        known = counts[i].pairs;
    }
    if lane == 0u {
        atomicStore(&found_counts[r], 0u);
        atomicStore(&double_counts[r], 0u);
    }
    workgroupBarrier();
    if builds {
        find_near(scene, i, lane, r);
    }
    workgroupBarrier();
    let near = min(atomicLoad(&found_counts[r]), MAX_NEIGHBOURS);
    workgroupBarrier();
    // A periodic image may share cells with the position itself: all but the first of equal numbers go.
    var is_double = array<bool, MAX_NEIGHBOURS / LANES>();
    if builds && scene.period_y != 0 {
        for (var k = lane; k < near; k += LANES) {
            is_double[k / LANES] = is_found(r, k, found[r][k]);
        }
    }
    workgroupBarrier();
    if builds && scene.period_y != 0 {
        for (var k = lane; k < near; k += LANES) {
            if is_double[k / LANES] {
                found[r][k] = NONE;
                atomicAdd(&double_counts[r], 1u);
            }
        }
    }
    workgroupBarrier();
    // A bond holds beyond the cutoff.
    if builds {
        for (var k = lane; k < known; k += LANES) {
            let pair = pairs[base + k * scene.count];
            if (pair.state & ~IN_CONTACT) != 0u && !is_found(r, near, pair.other) {
                add_found(r, pair.other);
            }
        }
    }
    workgroupBarrier();
    let found_count = atomicLoad(&found_counts[r]);
    let fitting = min(found_count, MAX_NEIGHBOURS);
    let count = found_count - atomicLoad(&double_counts[r]);
    if builds {
        for (var k = lane; k < fitting; k += LANES) {
            let other = found[r][k];
            let place = place_of(r, fitting, other);
            if other != NONE && place < dispatch.pair_capacity {
                new_pairs[base + place * scene.count] = Pair(vec3(0.0), other, vec3(0.0), 0u);
            }
        }
    }
    storageBarrier();
    // Without a state a pair has no history. The row of a run that has ended stays as it is.
    for (var k = lane; k < known; k += LANES) {
        let at = k * scene.count;
        let pair = pairs[base + at];
        var to = at;
        if builds {
            let place = place_of(r, fitting, pair.other);
            if pair.state == 0u || place >= dispatch.pair_capacity || !is_found(r, fitting, pair.other) {
                continue;
            }
            to = place * scene.count;
        }
        new_pairs[base + to] = pair;
        if has_moments(scene) {
            new_moments[moments_base + to] = moments[moments_base + at];
        }
    }
    if !exists || lane != 0u {
        return;
    }
    if !builds {
        new_counts[i].pairs = known;
        return;
    }
    new_counts[i].pairs = min(count, dispatch.pair_capacity);
    // A row that is too short ends the chunk, which is repeated with longer rows.
    if count > dispatch.pair_capacity {
        atomicMax(&reports[run].pairs, count);
    }
    if found_count > MAX_NEIGHBOURS {
        atomicMax(&reports[run].pairs, MAX_NEIGHBOURS + 1u);
    }
}
