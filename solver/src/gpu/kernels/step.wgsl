// A time step of one sub-particle: forces from the current sub-particles, motion into the next ones. The
// integration is the twin of cpu/integrate.rs.

const DOMAIN_LIMIT: i32 = 1 << 30;

// Moves the sub-particle by one step. Returns whether its motion is sound.
fn integrate(scene: Scene, i: u32, load: Load, me: ptr<function, Particle>) -> bool {
    let inverse_mass = 1.0 / (*me).mass;
    let v = new_velocity((*me).velocity, load.force, inverse_mass, scene.gravity, scene.dt);
    let spin = new_spin((*me).spin, load.torque, inverse_mass * scene.spin_factor, scene.dt);
    var remainder = private_state[i].remainder;
    let x = wrap(scene.period_y, new_position((*me).position, &remainder, v, scene.dt, scene.inverse_unit));
    private_state[i].remainder = remainder;
    (*me).position = x;
    (*me).velocity = v;
    (*me).spin = spin;
    let speed2 = dot3(v, v);
    let inside = all(x >= vec3(-DOMAIN_LIMIT)) && all(x <= vec3(DOMAIN_LIMIT));
    let spins = is_finite(spin.x) && is_finite(spin.y) && is_finite(spin.z);
    return is_finite(speed2) && speed2 <= scene.limit2 && spins && inside;
}

@compute @workgroup_size(GROUP_SIZE)
fn step(
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
    var me = particles[i];
    zero_bits = scene.zero_bits;
    if has_ended(scene, run) {
        moved[i] = me;
        return;
    }
    let since = reference[i].xyz;
    if length3(between(scene.unit_m, scene.period_y, since, me.position)) > scene.half_skin {
        atomicOr(&reports[run].stale, 1u);
    }
    var load = Load(vec3(0.0), vec3(0.0));
    let stats = add_pair_forces(scene, i, me, &load);
    let passed = add_wall_forces(scene, i, me, &load);
    if passed > 0u {
        atomicAdd(&reports[run].passed, passed);
    }
    // Positive floats compare like their bits. A load is cheaper than an atomic maximum, and most values do
    // not raise it.
    if stats.max_overlap > 0.0 && bitcast<u32>(stats.max_overlap) > atomicLoad(&reports[run].overlap) {
        atomicMax(&reports[run].overlap, bitcast<u32>(stats.max_overlap));
    }
    if stats.bonds_broken > 0u {
        private_state[i].broken += stats.bonds_broken;
        atomicAdd(&reports[run].broken, stats.bonds_broken);
    }
    if me.held == 0u {
        if !integrate(scene, i, load, &me) {
            atomicMin(&reports[run].fault_step, dispatch.step);
            atomicMin(&reports[run].runaway, i - scene.first);
        }
        let drift = bitcast<u32>(length3(between(scene.unit_m, scene.period_y, since, me.position)));
        if drift > atomicLoad(&reports[run].drift) {
            atomicMax(&reports[run].drift, drift);
        }
    }
    moved[i] = me;
}
