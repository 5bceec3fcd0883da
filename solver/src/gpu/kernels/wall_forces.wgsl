// Loads of facets: twin of the second half of cpu/forces.rs.

// Adds a force at the end of `arm`. Only its part `across` has a moment.
fn add(load: ptr<function, Load>, force: vec3<f32>, arm: vec3<f32>, across: vec3<f32>) {
    (*load).force += force;
    (*load).torque += cross3(arm, across);
}

// Writes the nearest points of a row of facets, from `begin` on: of every facet, or only of those that may act or remember
// anything. Returns the index after the last one, or NONE if the others matter too.
fn find_nearest_points(scene: Scene, begin: u32, facets: u32, me: Particle, every: bool) -> u32 {
    // Far more than points that coincide differ in distance.
    let margin = scene.radius / 16.0;
    var end = begin;
    for (var entry = 0u; entry < facets; entry++) {
        let wall = begin + entry * scene.count;
        let state = walls[wall].state;
        var point = wall_nearest_point(scene, walls[wall].facet, me.position);
        point.flags |= entry << ENTRY_SHIFT;
        if !every && depends_on_others(scene, state, point, me.velocity) {
            return NONE;
        }
        let reach = scene.radius + adhesion_range_of(law_of(scene, point.facet)) + margin;
        if every || state != 0u || point.distance < reach {
            nearest_points[end] = point;
            end += scene.count;
        }
    }
    return end;
}

// Returns how many surfaces the sub-particle has passed through.
fn add_wall_forces(scene: Scene, i: u32, me: Particle, load: ptr<function, Load>) -> u32 {
    let begin = row(scene, dispatch.wall_capacity, i);
    let facets = counts[i].walls;
    var end = find_nearest_points(scene, begin, facets, me, false);
    if end == NONE {
        end = find_nearest_points(scene, begin, facets, me, true);
    }
    if end == begin {
        return 0u;
    }
    let passed = update_sides(scene, begin, end, me.velocity);
    if end - begin > scene.count {
        transfer_history(scene, begin, end);
    }
    for (var k = begin; k < end; k += scene.count) {
        let point = nearest_points[k];
        let wall = wall_of(scene, begin, k);
        let law = law_of(scene, point.facet);
        var force = vec3(0.0);
        var history = ContactHistory(walls[wall].xi, (walls[wall].state & IN_CONTACT) != 0u);
        let is_out = (point.flags & BEYOND) == 0u && is_far(scene, point);
        if is_out || point.distance <= 0.0 || superseded_by(scene, begin, end, k) != NONE {
            history = ContactHistory(vec3(0.0), false);
        } else {
            let distance = signed_distance(point);
            let n = point.to_wall / distance;
            let v = me.velocity + cross3(me.spin, point.to_wall) - point.velocity;
            let delta = scene.radius - distance;
            let spin = pose_of(scene, surface_of(scene, point.facet)).spin;
            let contact = contact_force(law, &history, n, delta, v, spin, me.mass, SURFACE_CAP, scene.dt);
            if contact.acts {
                force = contact.normal + contact.tangential;
                add(load, force, point.to_wall, contact.tangential);
            }
        }
        let state = (walls[wall].state & SIDE_MEMORY) | select(0u, IN_CONTACT, history.in_contact);
        walls[wall] = WallPair(history.xi, point.facet, force, state);
    }
    return passed;
}
