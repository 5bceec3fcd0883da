// The bond: twin of physics/bond.rs, which states the equations.

struct BondForce {
    total: vec3<f32>,
    shear: vec3<f32>,
    // False when the bond breaks.
    holds: bool,
}

fn bond_normal(law: Bonds, rest_length: f32, length: f32) -> f32 {
    let e = length - rest_length;
    if law.model == FINITE_EXTENSION && e > 0.0 {
        let ratio = min(e / (law.break_length - rest_length), STRETCH_CLAMP);
        return law.k_n * e / (1.0 - ratio * ratio);
    }
    return law.k_n * e;
}

fn mid_step(n: vec3<f32>, length: f32, u_t: vec3<f32>, v_t: vec3<f32>, stretch: f32, twist: f32) -> vec3<f32> {
    let stretched = (u_t * 2.0 - v_t) * (stretch / (2.0 * max(length, NO_LENGTH_M)));
    return v_t + stretched + cross3(n, u_t + v_t) * (twist * 0.5);
}

fn bond_force(
    law: Bonds,
    stored: ptr<function, vec3<f32>>,
    n: vec3<f32>,
    rest_length: f32,
    length: f32,
    u: vec3<f32>,
    v: vec3<f32>,
    spin: vec3<f32>,
    dt: f32,
) -> BondForce {
    if length > law.break_length {
        return BondForce(vec3(0.0), vec3(0.0), false);
    }
    let v_n = dot3(v, n);
    let v_t = v - n * v_n;
    var pull: f32;
    var shear: vec3<f32>;
    var total: vec3<f32>;
    if law.model == AS_PUBLISHED {
        *stored += (n * (law.k_n * v_n) + v_t * law.k_t) * dt;
        pull = dot3(*stored, n);
        shear = *stored - n * pull;
        total = *stored;
    } else {
        let twist = dot3(spin, n) * dt;
        let shear_rate = mid_step(n, length, u - n * v_n, v_t, v_n * dt, twist);
        *stored = rotated_history(*stored, n, twist) + shear_rate * (law.k_t * dt);
        pull = bond_normal(law, rest_length, length);
        shear = *stored;
        total = n * pull + *stored;
    }
    let yields = pull > law.normal_strength || dot3(shear, shear) > law.shear_strength * abs(law.shear_strength);
    return BondForce(total, shear, !yields);
}
