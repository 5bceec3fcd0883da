// Lists of facets with histories: twin of cpu/neighbour_list.rs.

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

@compute @workgroup_size(GROUP_SIZE)
fn wall_list(
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
        let begin = row(scene, dispatch.wall_capacity, i);
        for (var at = begin; at < begin + counts[i].walls * scene.count; at += scene.count) {
            new_walls[at] = walls[at];
        }
        new_counts[i].walls = counts[i].walls;
        return;
    }
    let count = build_walls(scene, i);
    new_counts[i].walls = min(count, dispatch.wall_capacity);
    if count > dispatch.wall_capacity {
        atomicMax(&reports[run].walls, count);
    }
    reference[i] = vec4(particles[i].position, 0);
}
