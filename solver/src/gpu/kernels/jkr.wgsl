// JKR: twin of physics/jkr.rs, which states the equations.

fn jkr_root(d: f32) -> f32 {
    let from_snap = X_SNAP + sqrt(max(d - D_SNAP, 0.0) / CURVATURE);
    var x = min(from_snap, sqrt(sqrt(max(d + from_snap, 0.0))));
    for (var k = 0; k < 3; k++) {
        let x3 = x * x * x;
        let slope = max(4.0 * x3 - 1.0, 1e-6);
        x = max(x - (x * x3 - x - d) / slope, X_SNAP);
    }
    return x;
}

fn jkr_force(law: Law, delta: f32) -> Elastic {
    let x = jkr_root(delta * law.inverse_overlap);
    let x3 = x * x * x;
    return Elastic(law.force * (4.0 / 3.0 * x3 * x3 - 2.0 * x3), law.area * (x * x));
}
