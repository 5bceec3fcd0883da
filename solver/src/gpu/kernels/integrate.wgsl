// One leapfrog step: twin of physics/integrate.rs, which states the equations.

fn new_velocity(v: vec3<f32>, force: vec3<f32>, inverse_mass: f32, gravity: vec3<f32>, dt: f32) -> vec3<f32> {
    return v + (force * inverse_mass + gravity) * dt;
}

fn new_spin(omega: vec3<f32>, torque: vec3<f32>, inverse_inertia: f32, dt: f32) -> vec3<f32> {
    return omega + torque * (inverse_inertia * dt);
}

// Rounds halves away from zero, as Rust does. WGSL's own `round` rounds them to even.
fn rounded(x: vec3<f32>) -> vec3<f32> {
    let whole = trunc(x);
    return select(whole, whole + sign(x), abs(x - whole) >= vec3(0.5));
}

fn new_position(
    x: vec3<i32>,
    remainder: ptr<function, vec3<f32>>,
    v: vec3<f32>,
    dt: f32,
    inverse_unit: f32,
) -> vec3<i32> {
    let moved = v * (dt * inverse_unit) + *remainder;
    let whole = rounded(moved);
    *remainder = moved - whole;
    return x + vec3<i32>(whole);
}
