// One contact: twin of physics/contact.rs, which states the equations.

struct ContactHistory {
    xi: vec3<f32>,
    in_contact: bool,
}

struct ContactForce {
    normal: vec3<f32>,
    tangential: vec3<f32>,
    // False without contact.
    acts: bool,
}

fn contact_force(
    law: Law,
    history: ptr<function, ContactHistory>,
    n: vec3<f32>,
    delta: f32,
    v: vec3<f32>,
    spin: vec3<f32>,
    m_star: f32,
    cap: vec2<f32>,
    dt: f32,
) -> ContactForce {
    let least = select(0.0, law.snap_overlap, law.adheres != 0u && (*history).in_contact);
    if !(delta >= least) {
        *history = ContactHistory(vec3(0.0), false);
        return ContactForce(vec3(0.0), vec3(0.0), false);
    }
    (*history).in_contact = true;
    var elastic: Elastic;
    if law.adheres != 0u {
        elastic = jkr_force(law, delta);
    } else {
        elastic = hertz_force(law.e_star, law.r_star, delta);
    }
    let a = elastic.a;
    let k_n = 2.0 * law.e_star * a;
    let k_t = 8.0 * law.g_star * a;
    let v_n = dot3(v, n);
    let v_t = v - n * v_n;
    let total = elastic.force + damping_constant(law.damping, k_n, m_star, cap.x, dt) * v_n;
    var tangential = vec3(0.0);
    if a > 0.0 {
        let eta_t = damping_constant(law.damping, k_t, m_star, cap.y, dt);
        var xi = rotated_history((*history).xi, n, dot3(spin, n) * dt) + v_t * dt;
        tangential = friction_force(&xi, v_t, k_t, eta_t, law.mu * max(total, 0.0));
        (*history).xi = xi;
    }
    return ContactForce(n * -total, tangential, true);
}
