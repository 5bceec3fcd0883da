// Loads of bonds and contacts: twin of the first half of cpu/forces.rs. LANES invocations share the pairs of a sub-particle, since
// one after another they would take most of the time of a step. The loads are then added in the order of the row.

// Sub-particles of a workgroup.
const ROWS: u32 = GROUP_SIZE / LANES;

// Loads of one pair on a sub-particle; 0 where none acts.
struct PairLoad {
    bond_force: vec3<f32>,
    bonds_broken: u32,
    bond_torque: vec3<f32>,
    bond_moment: vec3<f32>,
    contact_force: vec3<f32>,
    contact_torque: vec3<f32>,
}

var<workgroup> pair_loads: array<PairLoad, GROUP_SIZE>;
var<workgroup> row_lengths: array<u32, ROWS>;
var<workgroup> rounds: u32;

fn pair_load(scene: Scene, i: u32, at: u32, place: u32) -> PairLoad {
    var load = PairLoad(vec3(0.0), 0u, vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
    let me = particles[i];
    let pair = pairs[at];
    let other = particles[scene.first + pair.other];
    let d = between(scene.unit_m, scene.period_y, me.position, other.position);
    let length2 = dot3(d, d);
    var class_ = pair.state & ~IN_CONTACT;
    let bonded = class_ != 0u;
    var law = scene.tissue;
    var contact_distance = scene.contact_distance;
    if other.body != me.body {
        law = scene.body_tissue;
        contact_distance = scene.body_contact_distance;
    }
    let hold = contact_distance + adhesion_range_of(law);
    if !bonded && length2 > hold * hold {
        if pair.state != 0u {
            pairs[at] = Pair(vec3(0.0), pair.other, vec3(0.0), 0u);
        }
        return load;
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
    var stored = pair.bond;
    if bonded {
        let rest = scene.contact_distance * sqrt(f32(class_));
        var bond = scene.bond;
        var torque = vec3(0.0);
        if has_moments(scene) {
            var moment = moments[place];
            let m_star = me.mass * other.mass / (me.mass + other.mass);
            torque = bond_moment(scene.moment, &moment, n, other.spin - me.spin, spin, m_star, scene.dt);
            bond = weakened(scene.moment, bond, moment);
            moments[place] = moment;
        }
        let force = bond_force(bond, &stored, n, rest, length, u, v, spin, scene.dt);
        if force.holds {
            load.bond_force = force.total;
            load.bond_torque = cross3(arm, force.shear);
            load.bond_moment = torque;
        } else {
            class_ = 0u;
            stored = vec3(0.0);
            load.bonds_broken = select(0u, 1u, pair.other > i - scene.first);
        }
    }
    var history = ContactHistory(pair.xi, (pair.state & IN_CONTACT) != 0u);
    if !bonded || scene.contact_between_bonded != 0u {
        let m_star = me.mass * other.mass / (me.mass + other.mass);
        let delta = contact_distance - length;
        let cap = select(BODY_CAP, BONDED_CAP, bonded);
        let force = contact_force(law, &history, n, delta, -v, spin, m_star, cap, scene.dt);
        if force.acts {
            load.contact_force = force.normal + force.tangential;
            load.contact_torque = cross3(arm, force.tangential);
            if !bonded {
                report_overlap(scene_of[i], delta);
            }
        }
    }
    pairs[at] = Pair(stored, pair.other, history.xi, class_ | select(0u, IN_CONTACT, history.in_contact));
    return load;
}

// Positive floats compare like their bits. A load is cheaper than an atomic maximum, and most values do not raise it.
fn report_overlap(run: u32, overlap: f32) {
    if overlap > 0.0 && bitcast<u32>(overlap) > atomicLoad(&reports[run].overlap) {
        atomicMax(&reports[run].overlap, bitcast<u32>(overlap));
    }
}

@compute @workgroup_size(GROUP_SIZE)
fn pair_forces(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = (group.y * groups.x + group.x) * ROWS + local / LANES;
    let lane = local % LANES;
    let exists = i < dispatch.count;
    let run = scene_of[min(i, dispatch.count - 1u)];
    let scene = scenes[run];
    zero_bits = scene.zero_bits;
    var length = 0u;
    if exists && !has_ended(scene, run) {
        length = counts[i].pairs;
    }
    if lane == 0u {
        row_lengths[local / LANES] = length;
    }
    workgroupBarrier();
    if local == 0u {
        rounds = 0u;
        for (var k = 0u; k < ROWS; k++) {
            rounds = max(rounds, (row_lengths[k] + LANES - 1u) / LANES);
        }
    }
    let count = workgroupUniformLoad(&rounds);
    let base = row(scene, dispatch.pair_capacity, i);
    // The first lane adds forces, the second one torques.
    var sum = vec3(0.0);
    var bonds_broken = 0u;
    for (var round = 0u; round < count; round++) {
        let k = round * LANES + lane;
        if k < length {
            pair_loads[local] = pair_load(scene, i, base + k * scene.count, moment_row(scene, i) + k * scene.count);
        }
        workgroupBarrier();
        let end = min(LANES, length - min(length, round * LANES));
        for (var other = 0u; other < end; other++) {
            let at = local - lane + other;
            if lane == 0u {
                sum += pair_loads[at].bond_force;
                sum += pair_loads[at].contact_force;
                bonds_broken += pair_loads[at].bonds_broken;
            } else if lane == 1u {
                sum += pair_loads[at].bond_torque;
                sum += pair_loads[at].bond_moment;
                sum += pair_loads[at].contact_torque;
            }
        }
        workgroupBarrier();
    }
    if !exists {
        return;
    }
    if lane == 0u {
        loads[i].force = sum;
        if bonds_broken > 0u {
            private_state[i].broken += bonds_broken;
            atomicAdd(&reports[run].broken, bonds_broken);
        }
    } else if lane == 1u {
        loads[i].torque = sum;
    }
}
