// Damping: twin of physics/damping.rs, which states the equations.

fn damping_constant(factor: f32, stiffness: f32, m_star: f32, cap: f32, dt: f32) -> f32 {
    return min(factor * sqrt(stiffness * m_star), cap * m_star / dt);
}
