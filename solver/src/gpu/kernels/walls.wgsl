// Facets near a sub-particle: twin of walls/mod.rs and walls/contact.rs, and of equipment/facet.rs for the
// nearest point.

// A position relative to the anchor of a surface, in the axes of the surface, in metres.
fn wall_local(pose: Pose, unit_m: f32, x: vec3<i32>) -> vec3<f32> {
    return wall_unrotated(pose, vec3<f32>(x - pose.anchor) * unit_m);
}

fn wall_unrotated(pose: Pose, d: vec3<f32>) -> vec3<f32> {
    return vec3(pose.turn_x.x, pose.turn_y.x, pose.turn_z.x) * d.x
        + vec3(pose.turn_x.y, pose.turn_y.y, pose.turn_z.y) * d.y
        + vec3(pose.turn_x.z, pose.turn_y.z, pose.turn_z.z) * d.z;
}

fn wall_rotated(pose: Pose, v: vec3<f32>) -> vec3<f32> {
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

// Nearest point of a facet to a position. The facet has triangles: rows hold no others.
fn wall_nearest_point(scene: Scene, facet_number: u32, x: vec3<i32>) -> NearestPoint {
    let facet = facets[scene.first_facet + facet_number];
    let pose = pose_of(scene, facet.surface);
    let p = wall_local(pose, scene.unit_m, x);
    let local = nearest_on_facet(scene, facet, p);
    let d = local - p;
    let n = facet.normal;
    let along = dot3(n, d);
    let across = d - n * along;
    let distance2 = dot3(d, d);
    let distance = sqrt(distance2);
    let off2 = distance * distance - along * along;
    let is_off = off2 > max(OFF_FACET_SHARE * (distance * distance), COINCIDENT_M * COINCIDENT_M);
    return NearestPoint(
        wall_rotated(pose, d),
        distance,
        pose.velocity + cross3(pose.spin, wall_rotated(pose, local)),
        select(0u, ON_RIM, dot3(across, across) > 1e-6 * distance2) | select(0u, OFF_FACET, is_off),
        local,
        facet_number,
        p,
        -along,
    );
}

// Index in `walls` of the facet of point `at`, in the row that starts at `begin`.
fn wall_of(scene: Scene, begin: u32, at: u32) -> u32 {
    return begin + (nearest_points[at].flags >> ENTRY_SHIFT) * scene.count;
}

fn pose_of(scene: Scene, surface: u32) -> Pose {
    return poses[scene.first_pose + dispatch.step * scene.pose_stride + surface];
}

fn surface_of(scene: Scene, facet: u32) -> u32 {
    return facets[scene.first_facet + facet].surface;
}

fn law_of(scene: Scene, facet: u32) -> Law {
    return surfaces[scene.first_surface + surface_of(scene, facet)].law;
}

// Gap up to which an adhesive contact holds once it has formed, in metres; 0 without adhesion.
fn adhesion_range_of(law: Law) -> f32 {
    if law.adheres != 0u {
        return -law.snap_overlap;
    }
    return 0.0;
}

// Smallest distance of all points of a surface, from `begin` up to `end`, that coincide with point `at`.
fn rank(scene: Scene, begin: u32, end: u32, at: u32) -> f32 {
    let surface = surface_of(scene, nearest_points[at].facet);
    let local = nearest_points[at].local;
    var least = nearest_points[at].distance;
    for (var k = begin; k < end; k += scene.count) {
        if surface_of(scene, nearest_points[k].facet) == surface && length3(nearest_points[k].local - local) < COINCIDENT_M {
            least = min(least, nearest_points[k].distance);
        }
    }
    return least;
}

// Whether point `other` precedes point `at`.
fn precedes(scene: Scene, begin: u32, end: u32, other: u32, at: u32) -> bool {
    let further = nearest_points[other].distance - nearest_points[at].distance;
    if further < -COINCIDENT_M {
        return true;
    }
    if further > COINCIDENT_M {
        return false;
    }
    let theirs = rank(scene, begin, end, other);
    let mine = rank(scene, begin, end, at);
    if theirs != mine {
        return theirs < mine;
    }
    let is_other_beyond = (nearest_points[other].flags & BEYOND) != 0u;
    if is_other_beyond != ((nearest_points[at].flags & BEYOND) != 0u) {
        return is_other_beyond;
    }
    return nearest_points[other].facet < nearest_points[at].facet;
}

fn is_aligned_with(a: NearestPoint, b: NearestPoint) -> bool {
    var cosine = dot3(a.to_wall, b.to_wall);
    if ((a.flags ^ b.flags) & BEYOND) != 0u {
        cosine = -cosine;
    }
    return cosine > ALIGNED_COSINE * a.distance * b.distance;
}

fn contains_point(scene: Scene, facet: u32, point: NearestPoint) -> bool {
    let q = nearest_on_facet(scene, facets[scene.first_facet + facet], point.local);
    return length3(q - point.local) < max(COINCIDENT_M, EDGE_TOLERANCE * point.distance);
}

// The point, from `begin` up to `end`, that supersedes point `at`, or NONE: see walls/mod.rs.
fn superseded_by(scene: Scene, begin: u32, end: u32, at: u32) -> u32 {
    let point = nearest_points[at];
    let surface = surface_of(scene, point.facet);
    for (var k = begin; k < end; k += scene.count) {
        let is_other = k != at && surface_of(scene, nearest_points[k].facet) == surface;
        if is_other && precedes(scene, begin, end, k, at) && is_aligned_with(nearest_points[k], point) {
            return k;
        }
    }
    if (point.flags & ON_RIM) == 0u {
        return NONE;
    }
    for (var k = begin; k < end; k += scene.count) {
        let is_other = k != at && surface_of(scene, nearest_points[k].facet) == surface;
        if is_other && precedes(scene, begin, end, k, at) && contains_point(scene, nearest_points[k].facet, point) {
            return k;
        }
    }
    return NONE;
}

// Transfers the history of a facet that is now superseded to the facet that supersedes it: see
// walls/contact.rs.
fn transfer_history(scene: Scene, begin: u32, end: u32) {
    for (var k = begin; k < end; k += scene.count) {
        let is_out = (nearest_points[k].flags & BEYOND) == 0u && is_far(scene, nearest_points[k]);
        let wall = wall_of(scene, begin, k);
        if (walls[wall].state & IN_CONTACT) == 0u || is_out {
            continue;
        }
        var successor = k;
        for (var links = begin + scene.count; links < end; links += scene.count) {
            let next = superseded_by(scene, begin, end, successor);
            if next == NONE {
                break;
            }
            successor = next;
        }
        if successor != k {
            let to = wall_of(scene, begin, successor);
            if (walls[to].state & IN_CONTACT) == 0u {
                walls[to].xi = walls[wall].xi;
                walls[to].state |= IN_CONTACT;
            }
            walls[wall].xi = vec3(0.0);
            walls[wall].state &= ~IN_CONTACT;
        }
    }
}
