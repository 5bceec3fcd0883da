// Neighbour lists with histories: twin of cpu/neighbour_list.rs. Rows are sorted by index. Histories of bonds
// and contacts are carried over from the old rows.

// Neighbours of one sub-particle, in any order.
alias Neighbours = array<u32, MAX_NEIGHBOURS>;

fn contains(found: ptr<function, Neighbours>, count: u32, other: u32) -> bool {
    for (var k = 0u; k < count; k++) {
        if (*found)[k] == other {
            return true;
        }
    }
    return false;
}

// Number of neighbours below `other`: its place in the sorted row. Counting reads the same memory in all invocations side by
// side. A row sorted by insertion took most of the time of a rebuild.
fn place_of(found: ptr<function, Neighbours>, count: u32, other: u32) -> u32 {
    var place = 0u;
    for (var k = 0u; k < count; k++) {
        place += select(0u, 1u, (*found)[k] < other);
    }
    return place;
}

fn insert_wall(scene: Scene, base: u32, count: u32, facet: u32) -> u32 {
    let stride = scene.count;
    var at = min(count, dispatch.wall_capacity);
    while at > 0u && new_walls[base + (at - 1u) * stride].facet > facet {
        at--;
    }
    for (var k = min(count, dispatch.wall_capacity - 1u); k > at; k--) {
        new_walls[base + k * stride].facet = new_walls[base + (k - 1u) * stride].facet;
    }
    if at < dispatch.wall_capacity {
        new_walls[base + at * stride].facet = facet;
    }
    return count + 1u;
}

// Finds the neighbours in the 27 cells around `x`: the position of sub-particle `me`, or a periodic image of it. Returns the
// new count, which may exceed MAX_NEIGHBOURS.
fn find_near(scene: Scene, me: u32, x: vec3<i32>, found: ptr<function, Neighbours>, already: u32) -> u32 {
    var count = already;
    let position = particles[me].position;
    let body = particles[me].body;
    let cell = cell_of(scene, x) - vec3(1u);
    for (var k = 0u; k < 27u; k++) {
        let around = vec3(k % 3u, k / 3u % 3u, k / 9u);
        var next = atomicLoad(&heads[head_index(scene, cell + around)]);
        while next != 0u {
            let other = next - 1u;
            next = chain[other];
            let d = between(scene.unit_m, scene.period_y, position, particles[other].position);
            let cutoff = select(scene.cutoff, scene.body_cutoff, particles[other].body != body);
            if other == me || dot3(d, d) > cutoff * cutoff {
                continue;
            }
            // A periodic image may share cells with the position itself.
            let number = other - scene.first;
            if already > 0u && contains(found, min(already, MAX_NEIGHBOURS), number) {
                continue;
            }
            if count < MAX_NEIGHBOURS {
                (*found)[count] = number;
            }
            count++;
        }
    }
    return count;
}

fn build_pairs(scene: Scene, i: u32) -> u32 {
    let base = row(scene, dispatch.pair_capacity, i);
    let known = base + counts[i].pairs * scene.count;
    let x = particles[i].position;
    var found: Neighbours;
    var count = find_near(scene, i, x, &found, 0u);
    if scene.period_y != 0 {
        count = find_near(scene, i, x + vec3(0, scene.period_y, 0), &found, count);
        count = find_near(scene, i, x - vec3(0, scene.period_y, 0), &found, count);
    }
    // A bond holds beyond the cutoff.
    for (var at = base; at < known; at += scene.count) {
        let other = pairs[at].other;
        let is_bonded = (pairs[at].state & ~IN_CONTACT) != 0u;
        if is_bonded && !contains(&found, min(count, MAX_NEIGHBOURS), other) {
            if count < MAX_NEIGHBOURS {
                found[count] = other;
            }
            count++;
        }
    }
    let fitting = min(count, min(dispatch.pair_capacity, MAX_NEIGHBOURS));
    for (var k = 0u; k < fitting; k++) {
        let to = base + place_of(&found, fitting, found[k]) * scene.count;
        new_pairs[to] = Pair(vec3(0.0), found[k], vec3(0.0), 0u);
    }
    // Without a state a pair has no history.
    for (var at = base; at < known; at += scene.count) {
        let pair = pairs[at];
        if pair.state != 0u && contains(&found, fitting, pair.other) {
            let to = base + place_of(&found, fitting, pair.other) * scene.count;
            new_pairs[to] = pair;
            if has_moments(scene) {
                let row = moment_row(scene, i) - base;
                new_moments[row + to] = moments[row + at];
            }
        }
    }
    return count;
}

// Depth of a centre beyond the facets that it has memories of, in metres: see walls/side.rs.
fn depth_beyond(scene: Scene, begin: u32, end: u32, x: vec3<i32>) -> f32 {
    var depth = 0.0;
    for (var k = begin; k < end; k += scene.count) {
        if (walls[k].state & BEYOND) != 0u && facets[scene.first_facet + walls[k].facet].triangles != 0u {
            depth = max(depth, wall_nearest_point(scene, walls[k].facet, x).distance);
        }
    }
    return depth;
}

fn build_walls(scene: Scene, i: u32) -> u32 {
    let base = row(scene, dispatch.wall_capacity, i);
    let known = base + counts[i].walls * scene.count;
    let x = particles[i].position;
    let depth = depth_beyond(scene, base, known, x);
    let range = scene.wall_cutoff - 2.0 * scene.half_skin;
    var count = 0u;
    for (var surface = 0u; surface < scene.surfaces; surface++) {
        let tree = surfaces[scene.first_surface + surface];
        let pose = pose_of(scene, surface);
        let p = wall_local(pose, scene.unit_m, x);
        var cutoff = scene.wall_cutoff + depth;
        // Lists reach back over the last step.
        var own = pose.velocity + cross3(pose.spin, wall_rotated(pose, p));
        if pose.is_belt != 0u {
            own = vec3(0.0);
        }
        let step_m = length3(particles[i].velocity - own) * scene.dt;
        if step_m > range {
            cutoff += step_m - range;
        }
        var at = tree.first_node;
        while at < tree.end_node {
            let node = nodes[scene.first_node + at];
            if box_distance2(node.low, node.high, p) > cutoff * cutoff * 1.00001 {
                at = tree.first_node + node.next;
                continue;
            }
            at++;
            for (var k = 0u; k < (node.leaf & 7u); k++) {
                let leaf = leaves[scene.first_leaf + tree.first_leaf + node.leaf / 8u + k];
                let facet = facets[scene.first_facet + tree.first_facet + leaf];
                let boxed = box_distance2(facet.low, facet.high, p) <= cutoff * cutoff;
                if facet.triangles != 0u && boxed && length3(nearest_on_facet(scene, facet, p) - p) <= cutoff {
                    count = insert_wall(scene, base, count, tree.first_facet + leaf);
                }
            }
        }
    }
    var at = base;
    let end = base + min(count, dispatch.wall_capacity) * scene.count;
    for (var to = base; to < end; to += scene.count) {
        let facet = new_walls[to].facet;
        while at < known && walls[at].facet < facet {
            at += scene.count;
        }
        if at < known && walls[at].facet == facet {
            new_walls[to] = walls[at];
        } else {
            new_walls[to] = WallPair(vec3(0.0), facet, vec3(0.0), 0u);
        }
    }
    return count;
}

// Copies the rows unchanged.
fn copy_rows(scene: Scene, i: u32) {
    let count = counts[i];
    let base = row(scene, dispatch.pair_capacity, i);
    new_counts[i] = count;
    for (var at = base; at < base + count.pairs * scene.count; at += scene.count) {
        new_pairs[at] = pairs[at];
        if has_moments(scene) {
            new_moments[moment_row(scene, i) + at - base] = moments[moment_row(scene, i) + at - base];
        }
    }
    let begin = row(scene, dispatch.wall_capacity, i);
    for (var at = begin; at < begin + count.walls * scene.count; at += scene.count) {
        new_walls[at] = walls[at];
    }
}

@compute @workgroup_size(GROUP_SIZE)
fn neighbour_list(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation_index(group, groups, local);
    if i >= dispatch.count {
        return;
    }
    let run = scene_of[i];
    let scene = scenes[run];
    // A run has no poses after its last step; the next ones belong to another run.
    if has_ended(scene, run) {
        copy_rows(scene, i);
        return;
    }
    let pair_count = build_pairs(scene, i);
    let wall_count = build_walls(scene, i);
    new_counts[i] = Count(min(pair_count, dispatch.pair_capacity), min(wall_count, dispatch.wall_capacity));
    // A row that is too short ends the chunk, which is repeated with longer rows.
    if pair_count > min(dispatch.pair_capacity, MAX_NEIGHBOURS) {
        atomicMax(&reports[run].pairs, pair_count);
    }
    if wall_count > dispatch.wall_capacity {
        atomicMax(&reports[run].walls, wall_count);
    }
    reference[i] = vec4(particles[i].position, 0);
}
