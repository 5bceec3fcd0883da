//! A short scenario of every experiment, with everything that its monitor gathers.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses some of these")]

use roost_solver::scenario::{self, Scenario};
use serde_json::json;

/// Small runs of every experiment.
pub fn experiments() -> Vec<Scenario> {
    let numerics = json!({"timestep_s": "auto", "duration_s": 0.15});
    let documents = [
        json!({"experiment": "drop", "product": {"count": 2, "subparticle_radius_m": 0.009}, "numerics": numerics}),
        json!({
            "experiment": "scene", "product": {"subparticle_radius_m": 0.009}, "numerics": numerics,
            "scene": {
                "bodies": [{"position_m": [0, 0, 0.03]}, {"shape": 3, "position_m": [0.05, 0.02, 0.09]}],
                "surfaces": [{"name": "plate", "plate_m": [[-0.5, -0.5, 0], [1, 0, 0], [0, 1, 0]]}],
            },
        }),
        json!({
            "experiment": "scene", "product": {"spheres": true, "subparticle_radius_m": 0.009}, "numerics": numerics,
            "contact": {"surface_energy_radius_m": 0.004},
            "scene": {
                "bodies": [{"position_m": [0, 0, 0.03]}, {"position_m": [0.005, 0.002, 0.05]}],
                "surfaces": [{"name": "plate", "plate_m": [[-0.5, -0.5, 0], [1, 0, 0], [0, 1, 0]]}],
            },
        }),
        json!({
            "experiment": "compress", "compress": {"lattice": [4, 4, 3], "strain_rate_1_s": 0.5},
            "numerics": {"timestep_s": "auto", "output_interval_s": 0.005},
        }),
        json!({
            "experiment": "slide", "product": {"subparticle_radius_m": 0.01}, "numerics": {"timestep_s": "auto"},
            "slide": {"tilt_rate_deg_s": 30.0, "max_tilt_deg": 15.0},
        }),
        json!({
            "experiment": "bend", "product": {"subparticle_radius_m": 0.01}, "bend": {"support": "clamped"},
            "numerics": numerics,
        }),
        json!({
            "experiment": "hopper", "product": {"count": 6, "subparticle_radius_m": 0.01},
            "equipment": {"hopper_width_m": 0.22, "hopper_length_m": 0.2, "side_walls": "periodic", "feed_kg_s": 8},
            "numerics": {"timestep_s": "auto", "duration_s": 0.3, "rest_speed_m_s": 0.1},
        }),
    ];
    documents.iter().map(|document| scenario::from_value(document).expect("a sound scenario")).collect()
}

/// A surface that turns, and scenes in which bodies break up and leave in parts: fillets torn by a fall onto an edge, and single spheres.
pub fn fragments() -> Vec<Scenario> {
    let numerics = json!({"timestep_s": "auto", "duration_s": 0.25, "output_interval_s": 0.005});
    let documents = [
        json!({
            "experiment": "scene", "product": {"subparticle_radius_m": 0.01}, "numerics": numerics,
            "scene": {
                "bodies": [{"position_m": [0, 0, 0.03]}],
                "surfaces": [{
                    "name": "turntable", "plate_m": [[-0.3, -0.3, 0], [0.6, 0, 0], [0, 0.6, 0]], "motion": "moving",
                    "velocity_m_s": [0.2, 0, 0.1], "spin_deg_s": [20, 10, 90], "pivot_m": [0.05, 0, 0],
                }],
            },
        }),
        json!({
            "experiment": "scene", "product": {"subparticle_radius_m": 0.008}, "numerics": numerics,
            "bonds": {"normal_strength_pa": 3000.0, "shear_strength_pa": 3000.0},
            "scene": {
                "bodies": [
                    {"shape": 0, "position_m": [0.05, 0, 0.08], "velocity_m_s": [0, 0, -3]},
                    {"shape": 1, "position_m": [0.0, 0, 0.2], "velocity_m_s": [0.5, 0, -2]},
                ],
                "surfaces": [{"name": "plate", "plate_m": [[-0.06, -0.3, 0], [0.12, 0, 0], [0, 0.6, 0]]}],
                "margin_m": 0.05,
            },
        }),
        json!({
            "experiment": "hopper", "product": {"count": 300, "subparticle_radius_m": 0.01, "spheres": true},
            "equipment": {"hopper_width_m": 0.2, "hopper_length_m": 0.2, "gate_opening_m": 0.08, "belt_speed_m_s": 0.5},
            "numerics": {"timestep_s": "auto", "duration_s": 0.4, "rest_speed_m_s": 0.2},
        }),
        json!({
            "experiment": "hopper", "product": {"count": 8, "subparticle_radius_m": 0.01},
            "bonds": {"moment_stiffness_factor": 1.0},
            "equipment": {"hopper_width_m": 0.15, "hopper_length_m": 0.2, "gate_opening_m": 0.1,
                          "side_walls": "frictionless", "surface_loads": true},
            "numerics": {"timestep_s": "auto", "duration_s": 0.3, "rest_speed_m_s": 0.1},
        }),
    ];
    documents.iter().map(|document| scenario::from_value(document).expect("a sound scenario")).collect()
}
