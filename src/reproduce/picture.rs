//! Pictures of a run: what one sees of its sub-particles from one side, taken while it runs, drawn as SVG.
//!
//! A picture keeps only the discs that stick out from behind others, so that a full hopper is some thousand discs and
//! not tens of thousands.

use std::fmt::Write;

use roost_solver::engine::run::Snapshot;
use roost_solver::equipment::Presence;
use serde::{Deserialize, Serialize};

/// Where one looks from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum View {
    /// Along the belt's width: x to the right, z upwards.
    Side,
    /// From above: x to the right, y upwards.
    Top,
}

/// The moment of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum When {
    /// Before the first step.
    First,
    /// The first sample from this belt time on, in seconds.
    At(f64),
    /// The last sample of the run.
    Last,
}

/// A picture that is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Shot {
    pub(super) view: View,
    pub(super) when: When,
}

impl Shot {
    pub(super) fn side(when: When) -> Self {
        Self { view: View::Side, when }
    }
}

/// A disc: its middle across and up in metres, and the number of its body.
type Disc = (f32, f32, u32);

/// What was seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Picture {
    pub(super) shot: Shot,
    /// Simulated time since the run began, in seconds.
    pub(super) simulated_s: f64,
    /// Belt time, in seconds.
    pub(super) belt_time_s: Option<f64>,
    pub(super) radius_m: f32,
    /// From the farthest to the nearest.
    pub(super) discs: Vec<Disc>,
    /// Triangles of the equipment that are seen from the side or at a slant.
    pub(super) outlines: Vec<[(f32, f32); 3]>,
}

/// Pixels that half a disc takes when it is found out what others hide.
const PIXELS_A_RADIUS: f32 = 5.0;
/// Part of a triangle's area that is seen when one looks straight at it, above which it would hide all behind it.
const FACE_ON: f64 = 0.95;

impl Picture {
    /// Takes a picture of a moment, with all that others hide.
    pub(super) fn take(shot: Shot, snapshot: &Snapshot<'_>) -> Self {
        let state = snapshot.state;
        // Across, up, and towards the viewer.
        let turned = |x: f64, y: f64, z: f64| match shot.view {
            View::Side => (x, z, -y),
            View::Top => (x, y, z),
        };
        let mut discs: Vec<(Disc, f64)> = (0..state.particles.len())
            .map(|i| {
                let place = state.position(i);
                let (across, up, near) = turned(place.x, place.y, place.z);
                ((tenths(across), tenths(up), state.bodies[i]), near)
            })
            .collect();
        discs.sort_by(|a, b| a.1.total_cmp(&b.1));
        let discs: Vec<Disc> = discs.into_iter().map(|disc| disc.0).collect();
        let is_there = |presence| presence == Presence::Always || snapshot.belt_time_s.is_none();
        let surfaces = snapshot.scene.surfaces.iter().filter(|surface| is_there(surface.presence));
        let outlines = surfaces.flat_map(|surface| {
            let pose = surface.motion.pose(snapshot.belt_time_s);
            let pivot = match surface.motion {
                roost_solver::equipment::Motion::Moving { pivot, .. } => pivot,
                _ => Default::default(),
            };
            surface.triangles.iter().filter_map(move |corners| {
                let moved = corners.map(|corner| pivot + pose.shift + pose.turn * (corner - pivot));
                let normal = (moved[1] - moved[0]).cross(moved[2] - moved[0]).normalize_or_zero();
                let (_, _, towards_us) = turned(normal.x, normal.y, normal.z);
                let seen = moved.map(|corner| turned(corner.x, corner.y, corner.z));
                let flat = seen.map(|(across, up, _)| (tenths(across), tenths(up)));
                (towards_us.abs() < FACE_ON).then_some(flat)
            })
        });
        Self {
            shot,
            simulated_s: snapshot.simulated_s,
            belt_time_s: snapshot.belt_time_s,
            radius_m: state.radius_m,
            discs,
            outlines: outlines.collect(),
        }
    }

    /// The same without what others hide.
    pub(super) fn of_what_is_seen(self) -> Self {
        Self { discs: visible(self.discs, self.radius_m), ..self }
    }

    /// The lowest and highest corner of all discs.
    fn bounds(&self) -> [f32; 4] {
        let start = [f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
        let r = self.radius_m;
        self.discs.iter().fold(start, |[left, low, right, high], &(x, y, _)| {
            [left.min(x - r), low.min(y - r), right.max(x + r), high.max(y + r)]
        })
    }

    /// Draws the picture, as an SVG document so many pixels wide at most, with a rule for scale.
    pub(super) fn svg(&self, title: &str, width: f32) -> String {
        let [left, low, right, high] = self.bounds();
        if left > right {
            return String::new();
        }
        let margin = 2.0 * self.radius_m;
        let (left, low) = (left - margin, low - margin);
        let (across, up) = (right + margin - left, high + margin - low);
        let scale = (width / across).min(width / up);
        let place = |x: f32, y: f32| ((x - left) * scale, (low + up - y) * scale);
        let mut svg = String::new();
        let (w, h) = (across * scale, up * scale + 22.0);
        let mut add = |text: std::fmt::Arguments<'_>| svg.write_fmt(text).expect("memory");
        add(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" aria-label=\"{title}\" width=\"{w:.0}\" \
             height=\"{h:.0}\" viewBox=\"0 0 {w:.1} {h:.1}\">\n"
        ));
        add(format_args!("<g fill=\"#999\" fill-opacity=\"0.15\" stroke=\"#888\" stroke-width=\"1.5\">\n"));
        for corners in &self.outlines {
            // Kept near the picture: a belt goes on for far.
            let near = |(x, y): (f32, f32)| {
                (x.clamp(left - across, left + 2.0 * across), y.clamp(low - up, low + 2.0 * up))
            };
            let [a, b, c] = corners.map(near).map(|(x, y)| place(x, y));
            add(format_args!(
                "<path d=\"M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}Z\"/>\n",
                a.0, a.1, b.0, b.1, c.0, c.1
            ));
        }
        add(format_args!("</g>\n<g stroke=\"#000\" stroke-opacity=\"0.35\" stroke-width=\"0.6\">\n"));
        for &(x, y, body) in &self.discs {
            let ((x, y), r) = (place(x, y), self.radius_m * scale);
            let colour = colour(body);
            add(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\" fill=\"{colour}\"/>\n"));
        }
        add(format_args!("</g>\n"));
        let rule_m = rule(across);
        let (from, to, y) = (6.0, 6.0 + rule_m * scale, h - 7.0);
        add(format_args!(
            "<path d=\"M{from} {y:.1}H{to:.1}\" stroke=\"currentColor\" stroke-width=\"2\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"currentColor\">{:.0} mm</text>\n</svg>\n",
            to + 6.0,
            y + 4.0,
            rule_m * 1e3
        ));
        svg
    }
}

/// A colour for a body, far from those of its neighbours in number: a golden angle on.
fn colour(body: u32) -> String {
    let hue = (body as f32 * 137.508 + 20.0) % 360.0;
    let light = [62, 72, 54][body as usize % 3];
    format!("hsl({hue:.0} 58% {light}%)")
}

/// A round length of about a quarter of the width, in metres.
fn rule(across_m: f32) -> f32 {
    let power = 10f32.powf((across_m / 4.0).log10().floor());
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|digit| digit * power)
        .find(|rule| *rule <= across_m / 4.0)
        .unwrap_or(power)
}

/// Rounded to a tenth of a millimetre: more is not seen.
fn tenths(metres: f64) -> f32 {
    ((metres * 1e4).round() / 1e4) as f32
}

/// Those of the discs, sorted from the farthest on, that the nearer ones do not hide.
fn visible(discs: Vec<Disc>, radius_m: f32) -> Vec<Disc> {
    let pixel = radius_m / PIXELS_A_RADIUS;
    let reach = PIXELS_A_RADIUS as i32;
    let mut covered = std::collections::HashSet::new();
    let mut seen = Vec::new();
    for disc in discs.into_iter().rev() {
        let (column, line) = ((disc.0 / pixel).round() as i32, (disc.1 / pixel).round() as i32);
        let mut is_seen = false;
        for (x, y) in (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| (x, y))) {
            if x * x + y * y < reach * reach {
                is_seen |= covered.insert((column + x, line + y));
            }
        }
        if is_seen {
            seen.push(disc);
        }
    }
    seen.reverse();
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_hidden_is_left_out_and_what_sticks_out_stays() {
        let (far, hidden, near) = ((0.015, 0.0, 0), (0.0, 0.0, 1), (0.0, 0.0, 2));
        assert_eq!(visible(vec![far, hidden, near], 0.01), [far, near]);
    }

    #[test]
    fn a_picture_shows_each_disc_in_its_bodys_colour() {
        let picture = Picture {
            shot: Shot::side(When::Last),
            simulated_s: 1.0,
            belt_time_s: None,
            radius_m: 0.004,
            discs: vec![(0.0, 0.0, 0), (0.008, 0.1, 1)],
            outlines: vec![[(-9.0, 0.0), (9.0, 0.0), (0.0, 0.0)]],
        };
        let svg = picture.svg("two discs", 400.0);
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(svg.contains(&colour(0)) && svg.contains(&colour(1)) && colour(0) != colour(1));
        assert!(svg.contains("5 mm") && svg.contains("two discs"), "{svg}");
        let empty = Picture { discs: Vec::new(), ..picture };
        assert_eq!(empty.svg("nothing", 400.0), "");
    }

    #[test]
    fn rules_are_round() {
        for (across, expected) in [(0.4, 0.1), (0.3, 0.05), (0.116, 0.02)] {
            assert!((rule(across) - expected).abs() < 1e-6, "{across}: {}", rule(across));
        }
    }
}
