//! Fig. 8: the angle at which a fillet begins to slide, over friction and surface energy.

use serde_json::{Value, json};

use super::{curve, plotted};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::{Demand, Row};
use crate::reproduce::stats::line;
use crate::ui::format::significant;
use crate::ui::plot::{Curve, Look, Mark, Scale};

/// Friction of Table 2, which the paper chose by this test.
const TABLE_2: f64 = 0.5;
/// Up to this friction a fillet follows Coulomb; above, it tumbles.
const COULOMB: f64 = 0.5;
/// Surface energies that are compared, Table 2's in the middle, in J/m².
const ENERGIES_J_M2: [f64; 3] = [0.0, 0.055, 0.11];
/// Contact radius over R of a lattice of one type, whose diagonal bonds let nothing turn.
const TRUSS: f64 = 1.5;
/// Heading of the fillet is drawn from this much to either side when there are several seeds, in degrees.
const SCATTER_DEG: f64 = 180.0;

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 8",
        title: "Fig. 8: sliding angle over friction and surface energy",
        part: Part::Slide,
        paper: "The sliding angle depends nearly linearly on the coefficient of friction; surface energy has a negligible \
                influence, and water did not change the measured angle. 0.5 was chosen for fillets on steel.",
        runs: runs(profile),
        tell: told,
    }
}

fn name(friction: f64, energy: f64) -> String {
    format!("μ {}, γ {} J/m²", significant(friction), significant(energy))
}

fn runs(profile: &Profile) -> Vec<Run> {
    let base = json!({
        "experiment": "slide",
        "product": {"subparticle_radius_m": profile.radius_m},
        "slide": {"tilt_rate_deg_s": profile.tilt_rate_deg_s},
        "numerics": {"timestep_s": "auto"},
    });
    let at = |friction: f64, energy: f64| -> Value {
        let contact = json!({"static_friction": friction, "surface_energy_j_m2": energy});
        with(&base, json!({"contact": {"fillet_equipment": contact}}))
    };
    let mut pairs: Vec<(f64, f64)> =
        profile.frictions.iter().map(|friction| (*friction, ENERGIES_J_M2[1])).collect();
    pairs.extend(ENERGIES_J_M2.map(|energy| (TABLE_2, energy)));
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    pairs.dedup();
    let runs =
        pairs.into_iter().map(|(friction, energy)| Run::new(name(friction, energy), at(friction, energy)));
    let askew = with(&at(TABLE_2, ENERGIES_J_M2[1]), json!({"slide": {"scatter_deg": SCATTER_DEG}}));
    let truss =
        with(&at(TABLE_2, ENERGIES_J_M2[1]), json!({"bonds": {"types": 1, "contact_radius_ratio": TRUSS}}));
    let seeds = Run::seeds("Table 2", &askew, profile.fillet_seeds);
    runs.chain(seeds).chain([Run::new("truss", truss)]).collect()
}

fn told(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 8";
    let angle = |friction: f64, energy: f64| results.value(&name(friction, energy), "critical_angle_deg");
    let known = |friction: &f64| Some((*friction, angle(*friction, ENERGIES_J_M2[1])?));
    let points: Vec<(f64, f64)> = profile.frictions.iter().filter_map(known).collect();
    let rate = format!("tilted by {} °/s", significant(profile.tilt_rate_deg_s));
    let mut rows = vec![
        Row::new(NAME, "R² of a straight line through the sliding angle over μ", "")
            .paper("strong linear correlation")
            .from_all(line(&points).map(|line| line.r2), points.len())
            .demand(Demand::AtLeast(0.95))
            .note(rate),
    ];
    for friction in profile.frictions.iter().copied().filter(|friction| *friction <= COULOMB) {
        let expected = friction.atan().to_degrees();
        rows.push(
            Row::new(NAME, format!("sliding angle at μ = {}", significant(friction)), "°")
                .one(angle(friction, ENERGIES_J_M2[1]))
                .demand(Demand::Near((expected * 100.0).round() / 100.0, 3.0))
                .note("atan μ, within 3°"),
        );
    }
    let angles = ENERGIES_J_M2.map(|energy| angle(TABLE_2, energy));
    let spread = angles.into_iter().collect::<Option<Vec<_>>>().map(|angles| {
        let (low, high) =
            angles.iter().fold((f64::INFINITY, 0f64), |(low, high), a| (low.min(*a), high.max(*a)));
        high - low
    });
    rows.push(
        Row::new(NAME, "spread of the sliding angle over surface energies 0, 0.055 and 0.11 J/m²", "°")
            .paper("negligible")
            .from_all(spread, ENERGIES_J_M2.len())
            .demand(Demand::Below(1.0)),
    );
    rows.push(
        Row::new(NAME, "sliding angle at Table 2, whatever way the fillet points", "°")
            .many(&results.values("Table 2", "critical_angle_deg"))
            .note("atan 0.5 is 26.57°"),
    );
    rows.push(
        Row::new(NAME, "sliding angle at μ = 0.5 with diagonal bonds", "°")
            .one(results.value("truss", "critical_angle_deg"))
            .note("one type of sub-particles bonded to 1.5 R: none of them can roll"),
    );
    let findings = vec![
        "Fig. 8b is an experiment with water on real fillets. There is nothing to simulate: in the model water is a change of \
         parameters."
            .to_owned(),
        "Fillets begin to slide some degrees before atan μ. Bonds carry no moments, so sub-particles can turn against each other \
         like gears, and some of those that touch the plate roll. With diagonal bonds, which hinder that, the angle is Coulomb's."
            .to_owned(),
    ];
    let frictions = profile.frictions.iter();
    let coulomb = frictions.clone().map(|friction| (*friction, Some(friction.atan().to_degrees())));
    let look = |colour, dash| Look { colour, dash };
    let mut curves = vec![
        curve(
            "γ 0.055 J/m²",
            look(0, 0),
            frictions.map(|friction| (*friction, angle(*friction, ENERGIES_J_M2[1]))),
        ),
        Curve { mark: Mark::None, ..curve("atan μ", look(6, 1), coulomb) },
    ];
    for (colour, energy) in [(1, ENERGIES_J_M2[0]), (2, ENERGIES_J_M2[2])] {
        let point = std::iter::once((TABLE_2, angle(TABLE_2, energy)));
        curves.push(Curve {
            mark: Mark::Alone,
            ..curve(&format!("γ {} J/m²", significant(energy)), look(colour, 0), point)
        });
    }
    let svg = plotted("coefficient of friction μ", "sliding angle (°)", Scale::Linear, None, curves);
    let illustrations =
        svg.map(|svg| Illustration::new(svg, "Sliding angle over friction, beside Coulomb's."));
    Told { rows, illustrations: illustrations.into_iter().collect(), findings }
}
