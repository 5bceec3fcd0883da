//! Every term of the physics is bit-equal in WGSL and in Rust, on random inputs.

#[path = "common/parity.rs"]
mod parity;
#[path = "common/terms.rs"]
mod terms;

use glam::Vec3;
use roost_solver::gpu::layout::Law;
use roost_solver::gpu::source::Source;
use roost_solver::mesh::nearest::{nearest_on_sliver, nearest_on_triangle};
use roost_solver::physics::bond::{self, BondLaw, BondModel};
use roost_solver::physics::contact::{self, ContactHistory, ContactLaw};
use roost_solver::physics::hertz::Moduli;
use roost_solver::physics::jkr::{self, JkrScale};
use roost_solver::physics::moment::{self, MomentHistory, MomentLaw};
use roost_solver::physics::{damping, friction, hertz, integrate};
use terms::{Numbers, Term};

fn v(x: &[f32], k: usize) -> Vec3 {
    Vec3::from_slice(&x[k..])
}

/// Vectors, each with components of this size.
fn vectors(sizes: &[f32]) -> Vec<std::ops::Range<f32>> {
    sizes.iter().flat_map(|&size| [-size..size, -size..size, -size..size]).collect()
}

const R_STAR: f32 = 0.002;
const GAMMA: f64 = 0.055;

fn scale() -> JkrScale {
    JkrScale::new(28_000.0, f64::from(R_STAR), GAMMA)
}

fn law(adheres: bool) -> ContactLaw {
    let moduli = Moduli { youngs: 28_000.0, shear: 5_300.0 };
    ContactLaw::new(moduli, f64::from(R_STAR), 0.1, 0.4, if adheres { GAMMA } else { 0.0 })
}

/// A unit vector, or nothing.
fn unit(v: Vec3) -> Vec3 {
    let length = v.length();
    if length > 0.0 { v / length } else { Vec3::ZERO }
}

fn contact_of(x: &[f32], adheres: bool) -> Vec<f32> {
    let mut history = ContactHistory { in_contact: x[0] > 0.0, xi: v(x, 1) };
    let force = contact::force(
        &law(adheres),
        &mut history,
        unit(v(x, 4)),
        x[7],
        v(x, 8),
        v(x, 11),
        x[14],
        damping::BODY_CAP,
        x[15],
    );
    let of = force.unwrap_or_default();
    let flags = [f32::from(u8::from(history.in_contact)), f32::from(u8::from(force.is_some()))];
    [&flags[..], &history.xi.to_array(), &of.normal.to_array(), &of.tangential.to_array()].concat()
}

fn common_bond() -> BondLaw {
    BondLaw {
        model: BondModel::Corotated,
        k_n: 50.0,
        k_t: 30.0,
        break_length: 0.01,
        normal_strength: 0.08,
        shear_strength: f32::INFINITY,
    }
}

fn bond_of(x: &[f32], model: BondModel) -> Vec<f32> {
    let law = BondLaw { model, ..common_bond() };
    let mut stored = v(x, 0);
    let force =
        bond::force(&law, &mut stored, unit(v(x, 3)), 0.008, x[6], v(x, 7), v(x, 10), v(x, 13), x[16]);
    let of = force.unwrap_or(bond::BondForce { total: Vec3::ZERO, shear: Vec3::ZERO });
    let holds = [f32::from(u8::from(force.is_some()))];
    [&holds[..], &stored.to_array(), &of.total.to_array(), &of.shear.to_array()].concat()
}

const CONTACT: &str = "
    var history = ContactHistory(x3(1u), x(0u) > 0.0);
    let d = x3(4u);
    let length = length3(d);
    var n = vec3(0.0);
    if length > 0.0 { n = d / length; }
    let force = contact_force(LAW, &history, n, x(7u), x3(8u), x3(11u), x(14u), BODY_CAP, x(15u));
    put(0u, select(0.0, 1.0, history.in_contact));
    put(1u, select(0.0, 1.0, force.acts));
    put3(2u, history.xi);
    put3(5u, force.normal);
    put3(8u, force.tangential);";

const BOND: &str = "
    var stored = x3(0u);
    let d = x3(3u);
    let length = length3(d);
    var n = vec3(0.0);
    if length > 0.0 { n = d / length; }
    let law = Bonds(FORM, 50.0, 30.0, 0.01, 0.08, 1e19);
    var force = bond_force(law, &stored, n, 0.008, x(6u), x3(7u), x3(10u), x3(13u), x(16u));
    if !force.holds { force.total = vec3(0.0); force.shear = vec3(0.0); }
    put(0u, select(0.0, 1.0, force.holds));
    put3(1u, stored);
    put3(4u, force.total);
    put3(7u, force.shear);";

/// The numbers of a law as inputs: what is known when a kernel is compiled might be worked out in another way.
fn law_inputs(law: &ContactLaw) -> Vec<std::ops::Range<f32>> {
    let law = Law::from(law);
    let numbers = [
        law.e_star,
        law.g_star,
        law.r_star,
        law.damping,
        law.mu,
        law.adheres as f32,
        law.force,
        law.area,
        law.inverse_overlap,
        law.snap_overlap,
    ];
    numbers.map(|number| number..number).to_vec()
}

/// The law whose numbers begin at an input.
fn wgsl_law(first: usize) -> String {
    let number =
        |k: usize| if k == 5 { format!("u32(x({}u))", first + k) } else { format!("x({}u)", first + k) };
    format!("Law({})", (0..10).map(number).collect::<Vec<_>>().join(", "))
}

fn contact_inputs(adheres: bool) -> Vec<std::ops::Range<f32>> {
    let snap = scale().snap_overlap;
    [
        vec![-1.0..1.0],
        vectors(&[1e-4, 1.0]),
        vec![1.2 * snap..0.002],
        vectors(&[1.0, 20.0]),
        vec![1e-5..1e-3, 1e-6..4e-4],
        law_inputs(&law(adheres)),
    ]
    .concat()
}

fn bond_inputs() -> Vec<std::ops::Range<f32>> {
    [vectors(&[0.05, 1.0]), vec![0.004..0.0105], vectors(&[1.0, 1.0, 20.0]), vec![1e-6..4e-4]].concat()
}

fn moment_of(x: &[f32]) -> Vec<f32> {
    let law = MomentLaw { k_b: 2e-4, k_w: 2.4e-4, rim: 500.0, inertia: 6.4e-6, damping: 1.7 };
    let mut history = MomentHistory { bending: v(x, 0), twist: x[3] };
    let moment = moment::moment(&law, &mut history, unit(v(x, 4)), v(x, 7), v(x, 10), x[14], x[13]);
    let bond = BondLaw { normal_strength: 0.08, shear_strength: 0.05, ..common_bond() };
    let weaker = law.weaken(&bond, &history);
    let strengths = [weaker.normal_strength, weaker.shear_strength];
    [&moment.to_array()[..], &history.bending.to_array(), &[history.twist], &strengths].concat()
}

const MOMENT: &str = "
    var history = Moment(x3(0u), x(3u));
    let d = x3(4u);
    let length = length3(d);
    var n = vec3(0.0);
    if length > 0.0 { n = d / length; }
    let law = Moments(x(15u), x(16u), x(17u), x(18u), x(19u));
    let moment = bond_moment(law, &history, n, x3(7u), x3(10u), x(14u), x(13u));
    let weaker = weakened(law, Bonds(COROTATED, 50.0, 30.0, 0.01, 0.08, 0.05), history);
    put3(0u, moment);
    put3(3u, history.bending);
    put(6u, history.twist);
    put(7u, weaker.normal_strength);
    put(8u, weaker.shear_strength);";

fn leak(text: String) -> &'static str {
    Box::leak(text.into_boxed_str())
}

fn terms() -> Vec<Term> {
    let mut terms = vec![
        Term {
            name: "quotient",
            inputs: vec![-3.0..3.0, 1e-3..2.0],
            outputs: 1,
            wgsl: "put(0u, x(0u) / x(1u));",
            rust: |x| vec![x[0] / x[1]],
        },
        Term {
            name: "root",
            inputs: vec![0.0..2.0],
            outputs: 1,
            wgsl: "put(0u, sqrt(x(0u)));",
            rust: |x| vec![x[0].sqrt()],
        },
        Term {
            name: "products of vectors",
            inputs: vectors(&[1.0, 2.0]),
            outputs: 4,
            wgsl: "put(0u, dot3(x3(0u), x3(3u))); put3(1u, cross3(x3(0u), x3(3u)));",
            rust: |x| {
                let (a, b) = (v(x, 0), v(x, 3));
                [&[a.dot(b)][..], &a.cross(b).to_array()].concat()
            },
        },
        Term {
            name: "damping",
            inputs: vec![0.0..2.0, 0.0..100.0, 1e-5..1e-3, 1e-5..1e-3],
            outputs: 6,
            wgsl: "var cap = array(BONDED_CAP, BODY_CAP, SURFACE_CAP); \
                   for (var k = 0u; k < 3u; k++) { \
                       put(2u * k, damping_constant(x(0u), x(1u), x(2u), cap[k].x, x(3u))); \
                       put(2u * k + 1u, damping_constant(x(0u), x(1u), x(2u), cap[k].y, x(3u))); \
                   }",
            rust: |x| {
                [damping::BONDED_CAP, damping::BODY_CAP, damping::SURFACE_CAP]
                    .iter()
                    .flat_map(|cap| [cap.normal, cap.tangential])
                    .map(|cap| damping::constant(x[0], x[1], x[2], cap, x[3]))
                    .collect()
            },
        },
        Term {
            name: "hertz",
            inputs: vec![0.0..0.004],
            outputs: 2,
            wgsl: "let e = hertz_force(28000.0, 0.002, x(0u)); put(0u, e.force); put(1u, e.a);",
            rust: |x| {
                let (force, a) = hertz::force(28_000.0, R_STAR, x[0]);
                vec![force, a]
            },
        },
        Term {
            name: "jkr root",
            inputs: vec![jkr::D_SNAP..40.0],
            outputs: 1,
            wgsl: "put(0u, jkr_root(x(0u)));",
            rust: |x| vec![jkr::root(x[0])],
        },
        Term {
            name: "jkr",
            inputs: [vec![scale().snap_overlap..0.004], law_inputs(&law(true))].concat(),
            outputs: 2,
            wgsl: leak(format!("let e = jkr_force({}, x(0u)); put(0u, e.force); put(1u, e.a);", wgsl_law(1))),
            rust: |x| {
                let (force, a) = jkr::force(&law(true).jkr.expect("adhesion"), x[0]);
                vec![force, a]
            },
        },
        Term {
            name: "rotated_history",
            inputs: [vectors(&[0.1, 1.0]), vec![-0.01..0.01]].concat(),
            outputs: 3,
            wgsl: "put3(0u, rotated_history(x3(0u), x3(3u), x(6u)));",
            rust: |x| friction::rotated_history(v(x, 0), v(x, 3), x[6]).to_array().to_vec(),
        },
        Term {
            name: "friction",
            inputs: [vectors(&[1e-4, 0.5]), vec![1.0..100.0, 0.0..0.1, 0.0..0.02]].concat(),
            outputs: 6,
            wgsl: "var xi = x3(0u); put3(0u, friction_force(&xi, x3(3u), x(6u), x(7u), x(8u))); put3(3u, xi);",
            rust: |x| {
                let mut xi = v(x, 0);
                let force = friction::force(&mut xi, v(x, 3), x[6], x[7], x[8]);
                [force.to_array(), xi.to_array()].concat()
            },
        },
        Term {
            name: "velocity and spin",
            inputs: [vectors(&[1.0, 0.1, 10.0]), vec![1e3..1e5, 1e-6..4e-4]].concat(),
            outputs: 6,
            wgsl: "put3(0u, new_velocity(x3(0u), x3(3u), x(9u), x3(6u), x(10u)));
                   put3(3u, new_spin(x3(0u), x3(3u), x(9u), x(10u)));",
            rust: |x| {
                let velocity = integrate::velocity(v(x, 0), v(x, 3), x[9], v(x, 6), x[10]);
                [velocity.to_array(), integrate::spin(v(x, 0), v(x, 3), x[9], x[10]).to_array()].concat()
            },
        },
        Term {
            name: "position",
            inputs: [vectors(&[0.5, 2.0]), vec![1e-6..4e-4]].concat(),
            outputs: 6,
            wgsl: "var rest = x3(0u); let at = new_position(vec3(7), &rest, x3(3u), x(6u), 5e8);
                   put3(0u, vec3<f32>(at)); put3(3u, rest);",
            rust: |x| {
                let mut rest = v(x, 0);
                let at = integrate::position(glam::IVec3::splat(7), &mut rest, v(x, 3), x[6], 5e8);
                [at.as_vec3().to_array(), rest.to_array()].concat()
            },
        },
        Term {
            name: "nearest point of a triangle",
            inputs: vectors(&[1.0, 1.0, 1.0, 2.0]),
            outputs: 3,
            wgsl: "put3(0u, nearest_on_triangle_f32(x3(9u), x3(0u), x3(3u), x3(6u)));",
            rust: |x| nearest_on_triangle(v(x, 9), &[v(x, 0), v(x, 3), v(x, 6)]).to_array().to_vec(),
        },
        Term {
            name: "nearest point of a long triangle",
            inputs: vectors(&[1.0, 1.0, 1.0, 2.0]),
            outputs: 3,
            wgsl: "let q = nearest_on_triangle_f64(
                       vec3<f64>(x3(9u)), vec3<f64>(x3(0u)), vec3<f64>(x3(3u)), vec3<f64>(x3(6u)));
                   put3(0u, vec3<f32>(q));",
            rust: |x| {
                let triangle = [v(x, 0), v(x, 3), v(x, 6)].map(|corner| corner.as_dvec3());
                nearest_on_sliver(v(x, 9).as_dvec3(), &triangle).as_vec3().to_array().to_vec()
            },
        },
    ];
    terms.push(Term {
        name: "moment of a bond",
        inputs: [
            vectors(&[1e-4]),
            vec![-1e-4..1e-4],
            vectors(&[1.0, 30.0, 20.0]),
            vec![1e-6..4e-4, 1e-5..1e-3],
            [2e-4, 2.4e-4, 500.0, 6.4e-6, 1.7].map(|number| number..number).to_vec(),
        ]
        .concat(),
        outputs: 9,
        wgsl: MOMENT,
        rust: moment_of,
    });
    for adheres in [false, true] {
        terms.push(Term {
            name: if adheres { "contact with adhesion" } else { "contact" },
            inputs: contact_inputs(adheres),
            outputs: 11,
            wgsl: leak(CONTACT.replace("LAW", &wgsl_law(16))),
            rust: if adheres { |x| contact_of(x, true) } else { |x| contact_of(x, false) },
        });
    }
    let forms: [(&str, &str, Numbers); 3] = [
        ("corotated bond", "COROTATED", |x| bond_of(x, BondModel::Corotated)),
        ("bond as published", "AS_PUBLISHED", |x| bond_of(x, BondModel::AsPublished)),
        ("bond of finite extension", "FINITE_EXTENSION", |x| bond_of(x, BondModel::FiniteExtension)),
    ];
    for (name, model, rust) in forms {
        terms.push(Term {
            name,
            inputs: bond_inputs(),
            outputs: 10,
            wgsl: leak(BOND.replace("FORM", model)),
            rust,
        });
    }
    terms
}

#[test]
fn gpu_force_terms_equal_cpu_force_terms_bit_for_bit() {
    let Some(device) = parity::device() else { return };
    let source = Source::terms();
    let differences: Vec<String> =
        terms().iter().filter_map(|term| term.difference(&device, &source)).collect();
    assert!(differences.is_empty(), "on {}:\n{}", device.name(), differences.join("\n"));
}

#[test]
fn planted_errors_in_every_force_term_are_detected_by_name() {
    let Some(device) = parity::device() else { return };
    // File, what stands there, what is planted, the first term that tells.
    let planted = [
        ("vector", "a.y * b.z - b.y * a.z", "a.y * b.z + b.y * a.z", "products of vectors"),
        ("damping", "stiffness * m_star", "stiffness * m_star * 1.000001", "damping"),
        ("damping", "cap * m_star / dt", "m_star / dt", "damping"),
        ("hertz", "4.0 / 3.0 * e_star", "1.333 * e_star", "hertz"),
        ("jkr", "k < 3", "k < 2", "jkr root"),
        ("jkr", "- 2.0 * x3", "- 2.00001 * x3", "jkr"),
        ("friction", "sqrt(before / after)", "1.0", "rotated_history"),
        ("friction", "*xi = -(force + v_t * eta_t) / k_t;", "", "friction"),
        ("contact", "law.mu * max(total, 0.0)", "law.mu * max(elastic.force, 0.0)", "contact"),
        ("contact", "&& (*history).in_contact", "", "contact with adhesion"),
        ("bond", "pull > law.normal_strength ||", "", "corotated bond"),
        ("bond", "shear = *stored - n * pull;", "shear = *stored;", "bond as published"),
        ("bond", "1.0 - ratio * ratio", "1.0 - ratio", "bond of finite extension"),
        ("moment", "dot3(spin, n) * dt", "0.0", "moment of a bond"),
        ("moment", "turn - n * rate", "turn", "moment of a bond"),
        ("integrate", "+ gravity) * dt", ") * dt", "velocity and spin"),
        ("integrate", "*remainder = moved - whole;", "", "position"),
        ("integrate", "abs(x - whole) >= vec3(0.5)", "abs(x - whole) > vec3(0.5)", "position"),
        ("nearest", "a + ac * (d2 / (d2 - d6))", "a + ac * (d2 / (d2 + d6))", "nearest point of a triangle"),
        (
            "nearest",
            "let d1 = dot_f64(ab, ap);",
            "let d1 = dot_f64(ab, p);",
            "nearest point of a long triangle",
        ),
    ];
    for (file, text, error, term) in planted {
        let source = Source::terms().with(file, text, error);
        let found = terms().iter().find_map(|term| term.difference(&device, &source)).unwrap_or_default();
        assert!(found.starts_with(&format!("{term}: ")), "{file}: `{error}` was found as `{found}`");
    }
}
