// The side of a facet from which a sub-particle touches it: twin of walls/side.rs. Memories are in the states of wall
// pairs. Rows are rebuilt when a surface disappears, so that none holds its facets.

const BOTH_SIDES: u32 = FROM_ABOVE | FROM_BELOW;
const SIDE_MEMORY: u32 = BOTH_SIDES | BEYOND;

// Whether a facet is out of range on the side where the sub-particle is.
fn is_far(scene: Scene, point: NearestPoint) -> bool {
    return scene.radius - point.distance < -adhesion_range_of(law_of(scene, point.facet));
}

// Distance of the centre, negative beyond the facet, in metres.
fn signed_distance(point: NearestPoint) -> f32 {
    return select(point.distance, -point.distance, (point.flags & BEYOND) != 0u);
}

// Side of a height, as a flag; 0 in the plane.
fn side_of(height: f32) -> u32 {
    return select(0u, FROM_ABOVE, height > 0.0) | select(0u, FROM_BELOW, height < 0.0);
}

// Motion of the centre relative to a facet in the last step, in the axes of the surface, in metres.
fn relative_motion(scene: Scene, point: NearestPoint, velocity: vec3<f32>) -> vec3<f32> {
    let pose = pose_of(scene, surface_of(scene, point.facet));
    var own = point.velocity;
    if pose.is_belt != 0u {
        own = vec3(0.0);
    }
    return wall_unrotated(pose, (velocity - own) * scene.dt);
}

// Whether the centre changed sides of the plane of a facet.
fn changes_sides(scene: Scene, point: NearestPoint, moved: vec3<f32>) -> bool {
    let before = point.height - dot3(facets[scene.first_facet + point.facet].normal, moved);
    return before * point.height < 0.0;
}

// Whether the centre crossed a facet within its rim.
fn crosses(scene: Scene, point: NearestPoint, moved: vec3<f32>) -> bool {
    if !changes_sides(scene, point, moved) {
        return false;
    }
    let facet = facets[scene.first_facet + point.facet];
    let before = point.height - dot3(facet.normal, moved);
    let share = point.height / (point.height - before);
    let crossing = point.centre - moved * share;
    let q = nearest_on_facet(scene, facet, crossing);
    return length3(q - crossing) < max(COINCIDENT_M, EDGE_TOLERANCE * length3(moved));
}

// Whether the centre has changed sides of a facet in the last step, through its surface.
fn has_crossed(scene: Scene, begin: u32, end: u32, at: u32, velocity: vec3<f32>) -> bool {
    let point = nearest_points[at];
    let moved = relative_motion(scene, point, velocity);
    if !changes_sides(scene, point, moved) {
        return false;
    }
    let surface = surface_of(scene, point.facet);
    for (var k = begin; k < end; k += scene.count) {
        if surface_of(scene, nearest_points[k].facet) == surface && crosses(scene, nearest_points[k], moved) {
            return true;
        }
    }
    return false;
}

fn alignment(scene: Scene, one: u32, other: u32) -> f32 {
    return dot3(facets[scene.first_facet + one].normal, facets[scene.first_facet + other].normal);
}

// Whether the facet of point `to` continues the facet of point `other`, of the same surface.
fn continues(scene: Scene, other: NearestPoint, to: NearestPoint) -> bool {
    let line = other.local - to.local;
    let height = abs(dot3(facets[scene.first_facet + to.facet].normal, line));
    let tolerance = max(COINCIDENT_M, EDGE_TOLERANCE * other.distance);
    return abs(alignment(scene, other.facet, to.facet)) > ALIGNED_COSINE
        && height < max(tolerance, ALIGNED_SINE * length3(line))
        && to.distance <= scene.radius + other.distance;
}

// Side of facet `at` from which a neighbour acts, beyond which the centre was before the step; 0 without one.
fn inherited(scene: Scene, begin: u32, end: u32, at: u32, side: u32) -> u32 {
    let facet = nearest_points[at].facet;
    let surface = surface_of(scene, facet);
    for (var k = begin; k < end; k += scene.count) {
        let other = nearest_points[k].facet;
        let state = walls[wall_of(scene, begin, k)].state;
        if k == at || (state & BEYOND) == 0u || surface_of(scene, other) != surface {
            continue;
        }
        let origin = state & BOTH_SIDES;
        if continues(scene, nearest_points[k], nearest_points[at]) {
            return select(origin, BOTH_SIDES ^ origin, alignment(scene, other, facet) < 0.0);
        }
        if (nearest_points[k].flags & OFF_FACET) != 0u && contains_point(scene, facet, nearest_points[k]) {
            return BOTH_SIDES ^ side;
        }
    }
    return 0u;
}

// The new memory of facet `at`, with the centre over its inside.
fn over_inside(scene: Scene, begin: u32, end: u32, at: u32, velocity: vec3<f32>) -> u32 {
    let memory = walls[wall_of(scene, begin, at)].state & SIDE_MEMORY;
    let side = side_of(nearest_points[at].height);
    if side == 0u {
        return memory;
    }
    var origin = memory & BOTH_SIDES;
    if origin == 0u {
        origin = inherited(scene, begin, end, at, side);
    }
    if origin == 0u {
        origin = side;
        if has_crossed(scene, begin, end, at, velocity) {
            origin = BOTH_SIDES ^ side;
        }
    }
    if side != origin {
        return origin | BEYOND;
    }
    return select(origin, 0u, is_far(scene, nearest_points[at]));
}

// The new memory of facet `at`, with the centre beside it; NONE if it ends at a free rim.
fn over_rim(scene: Scene, begin: u32, end: u32, at: u32) -> u32 {
    let memory = walls[wall_of(scene, begin, at)].state & SIDE_MEMORY;
    if (memory & BEYOND) == 0u {
        return 0u;
    }
    let point = nearest_points[at];
    let surface = surface_of(scene, point.facet);
    var is_shared = false;
    for (var k = begin; k < end; k += scene.count) {
        let other = nearest_points[k].facet;
        if k == at || surface_of(scene, other) != surface {
            continue;
        }
        let holds = contains_point(scene, other, point);
        let is_inside = (nearest_points[k].flags & OFF_FACET) == 0u;
        if is_inside && (holds || continues(scene, point, nearest_points[k])) {
            return 0u;
        }
        is_shared |= holds;
    }
    return select(NONE, memory, is_shared);
}

// Whether the memory of a facet, from its state, may depend on other facets of the row.
fn depends_on_others(scene: Scene, state: u32, point: NearestPoint, velocity: vec3<f32>) -> bool {
    if (state & BEYOND) != 0u {
        return true;
    }
    if (point.flags & OFF_FACET) != 0u {
        return false;
    }
    let origin = state & BOTH_SIDES;
    if origin != 0u {
        // The centre comes beyond the facet, which then acts at any distance.
        let side = side_of(point.height);
        return side != 0u && side != origin;
    }
    return changes_sides(scene, point, relative_motion(scene, point, velocity));
}

// Updates the memories of a row, in `walls` and `nearest_points`. Returns how many ended at a free rim while the centre
// was beyond.
fn update_sides(scene: Scene, begin: u32, end: u32, velocity: vec3<f32>) -> u32 {
    var passed = 0u;
    for (var k = begin; k < end; k += scene.count) {
        var memory: u32;
        if (nearest_points[k].flags & OFF_FACET) != 0u {
            memory = over_rim(scene, begin, end, k);
        } else {
            memory = over_inside(scene, begin, end, k, velocity);
        }
        if memory == NONE {
            passed++;
            memory = 0u;
        }
        nearest_points[k].flags |= memory;
    }
    for (var k = begin; k < end; k += scene.count) {
        let wall = wall_of(scene, begin, k);
        walls[wall].state = (walls[wall].state & ~SIDE_MEMORY) | (nearest_points[k].flags & SIDE_MEMORY);
    }
    return passed;
}
