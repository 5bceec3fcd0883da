// Moments of bonds: twin of physics/moment.rs, which states the equations.

// The strengths of a bond that these moments leave.
fn weakened(law: Moments, bond: Bonds, history: Moment) -> Bonds {
    var weaker = bond;
    weaker.normal_strength = bond.normal_strength - 2.0 * law.rim * length3(history.bending);
    weaker.shear_strength = bond.shear_strength - law.rim * abs(history.twist);
    return weaker;
}

fn bond_moment(
    law: Moments,
    history: ptr<function, Moment>,
    n: vec3<f32>,
    turn: vec3<f32>,
    spin: vec3<f32>,
    m_star: f32,
    dt: f32,
) -> vec3<f32> {
    let rate = dot3(turn, n);
    let across = turn - n * rate;
    let turned = rotated_history((*history).bending, n, dot3(spin, n) * dt);
    (*history).bending = turned + across * (law.k_b * dt);
    (*history).twist += law.k_w * rate * dt;
    let inertia = law.inertia * m_star;
    let eta_b = damping_constant(law.damping, law.k_b, inertia, MOMENT_CAP, dt);
    let eta_w = damping_constant(law.damping, law.k_w, inertia, MOMENT_CAP, dt);
    return (*history).bending + across * eta_b + n * ((*history).twist + eta_w * rate);
}
