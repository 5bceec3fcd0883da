// Hertz: twin of physics/hertz.rs, which states the equations.

struct Elastic {
    force: f32,
    // Radius of the contact area, in metres.
    a: f32,
}

fn hertz_force(e_star: f32, r_star: f32, delta: f32) -> Elastic {
    let a = sqrt(r_star * delta);
    return Elastic(4.0 / 3.0 * e_star * a * delta, a);
}
