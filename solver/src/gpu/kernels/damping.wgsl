// Damping: twin of physics/damping.rs.

const MOST: f32 = 0.5;
const ALONG: f32 = 1.0;
const ACROSS: f32 = 3.5;

fn damping_constant(factor: f32, stiffness: f32, m_star: f32, b: f32, dt: f32) -> f32 {
    return min(factor * sqrt(stiffness * m_star), MOST * m_star / (b * dt));
}
