//! Scenarios drawn from the field table: none makes the check panic, and what it accepts is placed apart.

mod common;

use common::document;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use roost_solver::engine::scene::Scene;
use roost_solver::engine::state::State;
use roost_solver::equipment::facet::facets;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::field::{Field, FieldKind, Range};
use roost_solver::scenario::fields::{FIELDS, experiments_of};
use roost_solver::scenario::{self, Scenario};
use roost_solver::{Limits, check};
use serde_json::{Value, json};

/// Draws scenarios from the field table.
struct Draw(ChaCha8Rng);

impl Draw {
    fn share(&mut self) -> f64 {
        self.0.next_u32() as f64 / f64::from(u32::MAX)
    }

    fn pick(&mut self, n: usize) -> usize {
        self.0.next_u32() as usize % n
    }

    /// Evenly over the magnitudes of a range, or over the range itself when it reaches zero or below.
    fn number(&mut self, range: Range) -> f64 {
        let share = 1e-6 + self.share() * (1.0 - 2e-6);
        match range.low {
            low if low > 0.0 => low * (range.high / low).powf(share),
            0.0 => range.high * 1e-12f64.powf(1.0 - share),
            low => low + (range.high - low) * share,
        }
    }

    /// The range to draw a field from: the table's, or less where a whole range would take hours.
    fn value(&mut self, pointer: &str, kind: FieldKind) -> Value {
        let mut within = |low, high| self.number(Range { low, high, low_open: false, high_open: false });
        match pointer {
            "/product/count" => return json!(within(1.0, 15.0).round()),
            "/product/scale" => return json!(within(0.5, 2.0)),
            "/product/subparticle_radius_m" => return json!(within(0.003, 0.05)),
            "/bonds/reference_radius_m" => return json!(within(0.003, 0.006)),
            "/product/sizes_m" => {
                let sizes = 1 + self.pick(3);
                let mut side =
                    || self.number(Range { low: 0.02, high: 0.3, low_open: false, high_open: false });
                return json!((0..sizes).map(|_| [side(), side(), side()]).collect::<Vec<_>>());
            }
            "/equipment/hopper_width_m" | "/equipment/hopper_length_m" => return json!(within(0.05, 2.0)),
            "/equipment/hopper_height_m" => return json!(within(0.1, 2.0)),
            "/equipment/gate_opening_m" => return json!(within(0.001, 0.1)),
            _ => {}
        }
        match kind {
            FieldKind::Number(range) => json!(self.number(range)),
            FieldKind::Nullable(range) if self.pick(2) == 0 => json!(self.number(range)),
            FieldKind::Nullable(_) => Value::Null,
            FieldKind::NumberOrAuto(range) if self.pick(4) == 0 => json!(self.number(range)),
            FieldKind::NumberOrAuto(_) => json!("auto"),
            FieldKind::Integer(range) => json!(self.number(range).round()),
            FieldKind::Choice(words) => json!(words[self.pick(words.len())]),
            FieldKind::Flag => json!(self.pick(2) == 0),
            FieldKind::NullableInteger(_) if self.pick(2) == 0 => json!(self.pick(2)),
            FieldKind::NullableInteger(_) => Value::Null,
            other => unreachable!("{pointer}: {other:?} is not drawn"),
        }
    }

    /// About half of the fields drawn, the others by default.
    fn scenario(&mut self) -> Option<Scenario> {
        let mut fields = Vec::new();
        let drawn = |pointer: &str| {
            let sections = ["/product/", "/material/", "/bonds/", "/contact/", "/equipment/", "/numerics/"];
            pointer == "/seed" || sections.iter().any(|section| pointer.starts_with(section))
        };
        let drawn = |field: &&Field| {
            drawn(field.pointer) && field.kind != FieldKind::Mesh && experiments_of(field).contains(&"hopper")
        };
        for field in FIELDS.iter().filter(drawn) {
            if self.pick(2) == 0 {
                fields.push((field.pointer, self.value(field.pointer, field.kind)));
            }
        }
        scenario::from_value(&document(&fields)).ok()
    }
}

#[test]
fn random_scenarios_never_panic_and_accepted_ones_start_without_overlap() {
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(1));
    let (mut sound, mut built) = (0, 0);
    while sound < 500 {
        let Some(scenario) = draw.scenario() else { continue };
        sound += 1;
        let _culprit = Culprit(&scenario);
        if let Ok(checked) = check(&scenario, &Meshes::default(), &Limits::default())
            && checked.estimate().subparticles < 20_000
        {
            built += 1;
            assert_placed_apart(&scenario, checked.setup().scene());
        }
    }
    // A feed makes about half of them too large.
    assert!(built > 90, "{built} of {sound} were built");
}

/// Shows the scenario when something panics over it.
struct Culprit<'a>(&'a Scenario);

impl Drop for Culprit<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("{}", serde_json::to_string(self.0).expect("serialises"));
        }
    }
}

/// No two sub-particles of different fillets overlap at their radius towards each other, none touches a wall, all lie between the walls.
fn assert_placed_apart(scenario: &Scenario, scene: &Scene) {
    let state = State::new(scene);
    let radius = scene.radius_m;
    let mut order: Vec<usize> = (0..state.particles.len()).collect();
    order.sort_by_key(|&i| state.particles[i].position.z);
    let unit = f64::from(state.frame.unit_m);
    let contact_distance = 2.0 * radius * scenario.contact.fillet_fillet_radius_ratio;
    let near = (contact_distance / unit) as i32 + 1;
    for (k, &i) in order.iter().enumerate() {
        let at = |i: usize| state.particles[i].position;
        let above = order[k + 1..].iter().take_while(|&&j| at(j).z - at(i).z <= near);
        for &j in above.filter(|&&j| state.bodies[i] != state.bodies[j]) {
            let apart = f64::from(state.frame.between(at(i), at(j)).length());
            assert!(apart >= contact_distance, "{i} and {j} are {apart} m apart");
        }
    }
    let equipment = scenario.equipment().expect("a hopper");
    let half = equipment.hopper_width_m / 2.0;
    let slope = equipment.wall_slope_deg.to_radians().tan();
    for i in 0..state.particles.len() {
        let x = state.position(i);
        assert!(x.z > radius && x.x < -radius && x.x > -equipment.hopper_length_m - x.z * slope, "{x}");
        assert!(x.y.abs() <= half + unit && x.cmple(scene.high).all() && x.cmpge(scene.low).all(), "{x}");
    }
    for surface in &scene.surfaces {
        let anchor = state.position(0);
        for facet in facets(&surface.triangles, anchor) {
            for i in 0..state.particles.len() {
                let p = (state.position(i) - anchor).as_vec3();
                let distance = facet.nearest(p).map_or(f32::INFINITY, |q| q.distance(p));
                assert!(f64::from(distance) > radius, "{i} touches the {}: {distance} m", surface.name);
            }
        }
    }
}
