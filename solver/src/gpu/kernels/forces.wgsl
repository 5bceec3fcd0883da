// The forces stage: twin of cpu/forces.rs. Every sub-particle gathers the loads of its bonds, contacts and
// walls.

struct Load {
    force: vec3<f32>,
    torque: vec3<f32>,
}

// Statistics of the stage.
struct ForceStats {
    max_overlap: f32,
    bonds_broken: u32,
}

// Adds a force at the end of `arm`. Only its part `across` has a moment.
fn add(load: ptr<function, Load>, force: vec3<f32>, arm: vec3<f32>, across: vec3<f32>) {
    (*load).force += force;
    (*load).torque += cross3(arm, across);
}

fn add_pair_forces(scene: Scene, i: u32, me: Particle, load: ptr<function, Load>) -> ForceStats {
    var stats = ForceStats(0.0, 0u);
    let base = row(scene, dispatch.pair_capacity, i);
    let end = base + counts[i].pairs * scene.count;
    for (var at = base; at < end; at += scene.count) {
        let state = pairs[at].state;
        let j = scene.first + pairs[at].other;
        let other = particles[j];
        let d = between(scene.unit_m, scene.period_y, me.position, other.position);
        let length2 = dot3(d, d);
        var class_ = state & ~IN_CONTACT;
        let bonded = class_ != 0u;
        var law = scene.tissue;
        var contact_distance = scene.contact_distance;
        if other.body != me.body {
            law = scene.body_tissue;
            contact_distance = scene.body_contact_distance;
        }
        let hold = contact_distance + adhesion_range_of(law);
        if !bonded && length2 > hold * hold {
            if state != 0u {
                pairs[at].state = 0u;
                pairs[at].xi = vec3(0.0);
            }
            continue;
        }
        let length = sqrt(length2);
        var n = vec3(0.0);
        if length > 0.0 {
            n = d / length;
        }
        let arm = n * (length / 2.0);
        let u = other.velocity - me.velocity;
        let v = u - cross3(me.spin + other.spin, arm);
        let spin = (me.spin + other.spin) * 0.5;
        if bonded {
            let rest = scene.contact_distance * sqrt(f32(class_));
            var stored = pairs[at].bond;
            var law = scene.bond;
            var torque = vec3(0.0);
            let place = moment_row(scene, i) + at - base;
            if has_moments(scene) {
                var moment = moments[place];
                let m_star = me.mass * other.mass / (me.mass + other.mass);
                torque = bond_moment(scene.moment, &moment, n, other.spin - me.spin, spin, m_star, scene.dt);
                law = weakened(scene.moment, law, moment);
                moments[place] = moment;
            }
            let force = bond_force(law, &stored, n, rest, length, u, v, spin, scene.dt);
            if force.holds {
                add(load, force.total, arm, force.shear);
                if has_moments(scene) {
                    (*load).torque += torque;
                }
            } else {
                class_ = 0u;
                stored = vec3(0.0);
                stats.bonds_broken += select(0u, 1u, i < j);
            }
            pairs[at].bond = stored;
        }
        var history = ContactHistory(pairs[at].xi, (state & IN_CONTACT) != 0u);
        if !bonded || scene.contact_between_bonded != 0u {
            let m_star = me.mass * other.mass / (me.mass + other.mass);
            let delta = contact_distance - length;
            let cap = select(BODY_CAP, BONDED_CAP, bonded);
            let force = contact_force(law, &history, n, delta, -v, spin, m_star, cap, scene.dt);
            if force.acts {
                add(load, force.normal + force.tangential, arm, force.tangential);
                if !bonded {
                    stats.max_overlap = max(stats.max_overlap, delta);
                }
            }
            pairs[at].xi = history.xi;
        }
        pairs[at].state = class_ | select(0u, IN_CONTACT, history.in_contact);
    }
    return stats;
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
