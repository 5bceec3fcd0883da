// Products of vectors, in glam's order of operations. WGSL leaves the order of its own `dot`, `cross` and
// `length` open.

// Always zero. Kernels read it from a buffer, so that compilers cannot know.
var<private> zero_bits: u32;

// The same vector, opaque to compilers. WGSL lets them regroup sums and products.
fn opaque(v: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(v) ^ vec3(zero_bits));
}

fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// Opaque: a compiler was seen to add a later summand to a part of the product first.
fn cross3(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return opaque(vec3(a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y));
}

fn length3(a: vec3<f32>) -> f32 {
    return sqrt(dot3(a, a));
}

// Whether x is finite, from its bits: compilers may assume that all numbers are.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}
