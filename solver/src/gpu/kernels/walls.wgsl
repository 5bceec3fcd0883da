// Facets near a sub-particle: twin of cpu/walls.rs, and of equipment/facet.rs for the nearest point.

// A position relative to the anchor of a surface, in its own axes, in metres.
fn wall_local(pose: Pose, unit_m: f32, x: vec3<i32>) -> vec3<f32> {
    let d = vec3<f32>(x - pose.anchor) * unit_m;
    return vec3(pose.turn_x.x, pose.turn_y.x, pose.turn_z.x) * d.x
        + vec3(pose.turn_x.y, pose.turn_y.y, pose.turn_z.y) * d.y
        + vec3(pose.turn_x.z, pose.turn_y.z, pose.turn_z.z) * d.z;
}

fn wall_turned(pose: Pose, v: vec3<f32>) -> vec3<f32> {
    return pose.turn_x * v.x + pose.turn_y * v.y + pose.turn_z * v.z;
}

// Square of the distance from a point to a box; 0 inside.
fn box_distance2(low: vec3<f32>, high: vec3<f32>, p: vec3<f32>) -> f32 {
    let outside = max(max(low - p, p - high), vec3(0.0));
    return dot3(outside, outside);
}

fn nearest_on_facet(scene: Scene, facet: Facet, p: vec3<f32>) -> vec3<f32> {
    var best = vec3(0.0);
    var best2 = 0.0;
    for (var k = 0u; k < facet.triangles; k++) {
        let first = scene.first_corner + 3u * (facet.first_triangle + k);
        let a = corners[first].at;
        let b = corners[first + 1u].at;
        let c = corners[first + 2u].at;
        var q: vec3<f32>;
        if facet.sliver != 0u {
            q = vec3<f32>(nearest_on_triangle_f64(vec3<f64>(p), vec3<f64>(a), vec3<f64>(b), vec3<f64>(c)));
        } else {
            q = nearest_on_triangle_f32(p, a, b, c);
        }
        let distance2 = dot3(p - q, p - q);
        if k == 0u || distance2 < best2 {
            best = q;
            best2 = distance2;
        }
    }
    return best;
}

// How a sub-particle at `x` touches a facet, which has triangles: rows hold no others.
fn wall_touch(scene: Scene, facet_number: u32, x: vec3<i32>) -> Touch {
    let facet = facets[scene.first_facet + facet_number];
    let pose = pose_of(scene, facet.surface);
    let p = wall_local(pose, scene.unit_m, x);
    let local = nearest_on_facet(scene, facet, p);
    let d = local - p;
    let n = facet.normal;
    let across = d - n * dot3(n, d);
    let distance2 = dot3(d, d);
    return Touch(
        wall_turned(pose, d),
        sqrt(distance2),
        pose.velocity + cross3(pose.spin, wall_turned(pose, local)),
        select(0u, 1u, dot3(across, across) > 1e-6 * distance2),
        local,
        facet_number,
    );
}

fn pose_of(scene: Scene, surface: u32) -> Pose {
    return poses[scene.first_pose + now.step * scene.pose_stride + surface];
}

fn surface_of(scene: Scene, facet: u32) -> u32 {
    return facets[scene.first_facet + facet].surface;
}

fn law_of(scene: Scene, facet: u32) -> Law {
    return surfaces[scene.first_surface + surface_of(scene, facet)].law;
}

// How far apart (in metres, not below 0) a contact that has formed still holds.
fn reach_of(law: Law) -> f32 {
    if law.adheres != 0u {
        return -law.snap_overlap;
    }
    return 0.0;
}

// The least distance of all touches of a surface, from `begin` up to `end`, that lie in the point of touch `at`.
fn rank(scene: Scene, begin: u32, end: u32, at: u32) -> f32 {
    let surface = surface_of(scene, touches[at].facet);
    let local = touches[at].local;
    var least = touches[at].distance;
    for (var k = begin; k < end; k++) {
        if surface_of(scene, touches[k].facet) == surface && length3(touches[k].local - local) < SAME {
            least = min(least, touches[k].distance);
        }
    }
    return least;
}

// Whether touch `other` comes before touch `at`.
fn comes_before(scene: Scene, begin: u32, end: u32, other: u32, at: u32) -> bool {
    let further = touches[other].distance - touches[at].distance;
    if further < -SAME {
        return true;
    }
    if further > SAME {
        return false;
    }
    let theirs = rank(scene, begin, end, other);
    let mine = rank(scene, begin, end, at);
    return theirs < mine || (theirs == mine && touches[other].facet < touches[at].facet);
}

fn pushes_like(a: Touch, b: Touch) -> bool {
    return dot3(a.to_wall, b.to_wall) > SAME_WAY * a.distance * b.distance;
}

fn has_the_point(scene: Scene, facet: u32, touch: Touch) -> bool {
    let q = nearest_on_facet(scene, facets[scene.first_facet + facet], touch.local);
    return length3(q - touch.local) < max(SAME, AT_THE_EDGE * touch.distance);
}

// The touch, from `begin` up to `end`, that touch `at` gives way to, or NONE: see cpu/walls.rs for why.
fn gives_way(scene: Scene, begin: u32, end: u32, at: u32) -> u32 {
    let touch = touches[at];
    let surface = surface_of(scene, touch.facet);
    for (var k = begin; k < end; k++) {
        let is_other = k != at && surface_of(scene, touches[k].facet) == surface;
        if is_other && comes_before(scene, begin, end, k, at) && pushes_like(touches[k], touch) {
            return k;
        }
    }
    if touch.on_rim == 0u {
        return NONE;
    }
    for (var k = begin; k < end; k++) {
        let is_other = k != at && surface_of(scene, touches[k].facet) == surface;
        if is_other && comes_before(scene, begin, end, k, at) && has_the_point(scene, touches[k].facet, touch) {
            return k;
        }
    }
    return NONE;
}

// Hands what the contact with a facet that gives way remembers on to the one that takes over: see cpu/forces.rs.
fn hand_over(scene: Scene, begin: u32, end: u32) {
    for (var k = begin; k < end; k++) {
        let is_far = scene.radius - touches[k].distance < -reach_of(law_of(scene, touches[k].facet));
        if walls[k].state == 0u || is_far {
            continue;
        }
        var heir = k;
        for (var links = begin + 1u; links < end; links++) {
            let next = gives_way(scene, begin, end, heir);
            if next == NONE {
                break;
            }
            heir = next;
        }
        if heir != k {
            if walls[heir].state == 0u {
                walls[heir].xi = walls[k].xi;
                walls[heir].state = walls[k].state;
            }
            walls[k].xi = vec3(0.0);
            walls[k].state = 0u;
        }
    }
}
