// The point of a triangle nearest to another point: twin of mesh/nearest.rs. REAL is f32 or, for slivers,
// f64; both are generated from this text.

fn dot_REAL(a: vec3<REAL>, b: vec3<REAL>) -> REAL {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

fn cross_REAL(a: vec3<REAL>, b: vec3<REAL>) -> vec3<REAL> {
    return vec3(a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y);
}

fn nearest_on_triangle_REAL(p: vec3<REAL>, a: vec3<REAL>, b: vec3<REAL>, c: vec3<REAL>) -> vec3<REAL> {
    let zero = REAL(0.0);
    let ab = b - a;
    let ac = c - a;
    let ap = p - a;
    let d1 = dot_REAL(ab, ap);
    let d2 = dot_REAL(ac, ap);
    if d1 <= zero && d2 <= zero {
        return a;
    }
    let bp = p - b;
    let d3 = dot_REAL(ab, bp);
    let d4 = dot_REAL(ac, bp);
    if d3 >= zero && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= zero && d1 >= zero && d3 <= zero {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let d5 = dot_REAL(ab, cp);
    let d6 = dot_REAL(ac, cp);
    if d6 >= zero && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= zero && d2 >= zero && d6 <= zero {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= zero && d4 - d3 >= zero && d5 - d6 >= zero {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let n = cross_REAL(ab, ac);
    return p - n * (dot_REAL(n, ap) / dot_REAL(n, n));
}
