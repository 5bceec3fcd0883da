// Products of vectors, in the command of operations of glam. WGSL's own `dot`, `cross` and `length` leave it open.

// Zero. Kernels take it from a buffer, so that compilers do not know.
var<private> zero_bits: u32;

// The same vector, into which compilers cannot look. WGSL lets them regroup sums and products.
fn opaque(v: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(v) ^ vec3(zero_bits));
}

fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// What is added to one of these was seen to be added to a part of it first.
fn cross3(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return opaque(vec3(a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y));
}

fn length3(a: vec3<f32>) -> f32 {
    return sqrt(dot3(a, a));
}

// Whether x is a number: told from its bits, since compilers may take all numbers for finite.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}
