// Fixed-point positions: twin of engine/frame.rs.

// The difference to the nearest periodic image, in units.
fn nearest_image(period_y: i32, y: i32) -> i32 {
    let half = period_y / 2;
    if y > half {
        return y - period_y;
    }
    if y < -half {
        return y + period_y;
    }
    return y;
}

// The position, wrapped into the period.
fn wrap(period_y: i32, x: vec3<i32>) -> vec3<i32> {
    if period_y == 0 {
        return x;
    }
    return vec3(x.x, nearest_image(period_y, x.y), x.z);
}

// The vector from a to b in metres, by the nearest periodic image.
fn between(unit_m: f32, period_y: i32, a: vec3<i32>, b: vec3<i32>) -> vec3<f32> {
    return vec3<f32>(wrap(period_y, b - a)) * unit_m;
}
