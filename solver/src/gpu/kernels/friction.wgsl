// Friction: twin of physics/friction.rs, which states the equations.

fn rotated_history(v: vec3<f32>, n: vec3<f32>, twist: f32) -> vec3<f32> {
    let twisted = v + cross3(n, v) * twist;
    let flat_ = twisted - n * dot3(twisted, n);
    let before = dot3(v, v);
    let after = dot3(flat_, flat_);
    if after <= 1e-30 {
        return flat_;
    }
    return flat_ * sqrt(before / after);
}

fn friction_force(xi: ptr<function, vec3<f32>>, v_t: vec3<f32>, k_t: f32, eta_t: f32, cap: f32) -> vec3<f32> {
    let trial = -(*xi * k_t) - v_t * eta_t;
    let size2 = dot3(trial, trial);
    if size2 <= cap * cap {
        return trial;
    }
    let force = trial * (cap / sqrt(size2));
    *xi = -(force + v_t * eta_t) / k_t;
    return force;
}
