//! Pictures of a run: its sub-particles in projection, taken during the run and drawn as SVG.
//!
//! A record has only the visible discs of a picture. This reduces a full hopper from tens of thousands to some thousand.

use std::fmt::Write;

use roost_solver::engine::run::Snapshot;
use serde::{Deserialize, Serialize};

/// The direction of a projection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum View {
    /// From the side of the belt: x to the right, z upwards.
    Side,
    /// From above: x to the right, y upwards.
    Top,
}

/// The moment of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Moment {
    /// Before the first step.
    First,
    /// The first sample at or after this belt time, in seconds.
    At(f64),
    /// The last sample of the run.
    Last,
}

/// A requested picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Shot {
    pub(crate) view: View,
    pub(crate) when: Moment,
}

impl Shot {
    pub(crate) fn side(when: Moment) -> Self {
        Self { view: View::Side, when }
    }
}

/// A disc: the two coordinates of its centre in metres, and the number of its body.
type Disc = (f32, f32, u32);

/// A projection of sub-particles and equipment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Picture {
    pub(crate) shot: Shot,
    /// Simulated time since the start of the run, in seconds.
    pub(crate) simulated_s: f64,
    /// Belt time, in seconds.
    pub(crate) belt_time_s: Option<f64>,
    pub(crate) radius_m: f32,
    /// From the farthest to the nearest disc.
    pub(crate) discs: Vec<Disc>,
    /// Triangles of the equipment, except those that face the viewer.
    pub(crate) outlines: Vec<[(f32, f32); 3]>,
}

/// Radius of a disc in pixels, for the test of visibility.
const PIXELS_PER_RADIUS: f32 = 5.0;
/// A triangle whose normal has more than this component towards the viewer would cover everything behind it.
const FACE_ON: f64 = 0.95;

impl Picture {
    /// Takes a picture, including the hidden discs.
    pub(crate) fn take(shot: Shot, snapshot: &Snapshot<'_>) -> Self {
        let state = snapshot.state;
        // Horizontal, vertical, and towards the viewer.
        let project = |x: f64, y: f64, z: f64| match shot.view {
            View::Side => (x, z, -y),
            View::Top => (x, y, z),
        };
        let mut discs: Vec<(Disc, f64)> = (0..state.particles.len())
            .map(|i| {
                let place = state.position(i);
                let (across, up, near) = project(place.x, place.y, place.z);
                ((to_tenths_mm(across), to_tenths_mm(up), state.bodies[i]), near)
            })
            .collect();
        discs.sort_by(|a, b| a.1.total_cmp(&b.1));
        let discs: Vec<Disc> = discs.into_iter().map(|disc| disc.0).collect();
        let outlines = snapshot.scene.surfaces.iter().flat_map(|surface| {
            let pose = surface.motion.pose(snapshot.belt_time_s);
            let pivot = match surface.motion {
                roost_solver::equipment::Motion::Moving { pivot, .. } => pivot,
                _ => Default::default(),
            };
            surface.triangles_at(snapshot.belt_time_s).iter().filter_map(move |corners| {
                let moved = corners.map(|corner| pivot + pose.shift + pose.turn * (corner - pivot));
                let normal = (moved[1] - moved[0]).cross(moved[2] - moved[0]).normalize_or_zero();
                let (_, _, towards_viewer) = project(normal.x, normal.y, normal.z);
                let projected = moved.map(|corner| project(corner.x, corner.y, corner.z));
                let outline = projected.map(|(across, up, _)| (to_tenths_mm(across), to_tenths_mm(up)));
                (towards_viewer.abs() < FACE_ON).then_some(outline)
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

    /// The picture without hidden discs.
    pub(crate) fn without_hidden_discs(self) -> Self {
        Self { discs: visible_discs(self.discs, self.radius_m), ..self }
    }

    /// Left, lower, right and upper bound of all discs.
    fn bounds(&self) -> [f32; 4] {
        let start = [f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
        let r = self.radius_m;
        self.discs.iter().fold(start, |[left, low, right, high], &(x, y, _)| {
            [left.min(x - r), low.min(y - r), right.max(x + r), high.max(y + r)]
        })
    }

    /// The picture as an SVG document of at most this width and height in pixels, with a scale bar.
    pub(crate) fn svg(&self, title: &str, size_px: f32) -> String {
        let [left, low, right, high] = self.bounds();
        if left > right {
            return String::new();
        }
        let margin = 2.0 * self.radius_m;
        let (left, low) = (left - margin, low - margin);
        let (across, up) = (right + margin - left, high + margin - low);
        let scale = (size_px / across).min(size_px / up);
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
            // A belt is much longer than the picture.
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
        let bar_m = scale_bar_m(across);
        let (from, to, y) = (6.0, 6.0 + bar_m * scale, h - 7.0);
        add(format_args!(
            "<path d=\"M{from} {y:.1}H{to:.1}\" stroke=\"currentColor\" stroke-width=\"2\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"currentColor\">{:.0} mm</text>\n</svg>\n",
            to + 6.0,
            y + 4.0,
            bar_m * 1e3
        ));
        svg
    }
}

/// The colour of a body. Consecutive hues differ by the golden angle, so that neighbours are distinct.
fn colour(body: u32) -> String {
    let hue = (body as f32 * 137.508 + 20.0) % 360.0;
    let light = [62, 72, 54][body as usize % 3];
    format!("hsl({hue:.0} 58% {light}%)")
}

/// Length of the scale bar: a round number of about a quarter of the width, in metres.
fn scale_bar_m(across_m: f32) -> f32 {
    let power = 10f32.powf((across_m / 4.0).log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|digit| digit * power).find(|bar| *bar <= across_m / 4.0).unwrap_or(power)
}

/// Rounded to a tenth of a millimetre, which is finer than a pixel.
fn to_tenths_mm(metres: f64) -> f32 {
    ((metres * 1e4).round() / 1e4) as f32
}

/// The discs that nearer ones do not cover; discs are sorted from the farthest to the nearest.
fn visible_discs(discs: Vec<Disc>, radius_m: f32) -> Vec<Disc> {
    let pixel = radius_m / PIXELS_PER_RADIUS;
    let reach = PIXELS_PER_RADIUS as i32;
    let mut covered = std::collections::HashSet::new();
    let mut visible = Vec::new();
    for disc in discs.into_iter().rev() {
        let (column, line) = ((disc.0 / pixel).round() as i32, (disc.1 / pixel).round() as i32);
        let mut is_visible = false;
        for (x, y) in (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| (x, y))) {
            if x * x + y * y < reach * reach {
                is_visible |= covered.insert((column + x, line + y));
            }
        }
        if is_visible {
            visible.push(disc);
        }
    }
    visible.reverse();
    visible
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_discs_are_left_out() {
        let (far, hidden, near) = ((0.015, 0.0, 0), (0.0, 0.0, 1), (0.0, 0.0, 2));
        assert_eq!(visible_discs(vec![far, hidden, near], 0.01), [far, near]);
    }

    #[test]
    fn each_disc_has_the_colour_of_its_body() {
        let picture = Picture {
            shot: Shot::side(Moment::Last),
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
    fn scale_bars_are_round() {
        for (across, expected) in [(0.4, 0.1), (0.3, 0.05), (0.116, 0.02)] {
            assert!((scale_bar_m(across) - expected).abs() < 1e-6, "{across}: {}", scale_bar_m(across));
        }
    }
}
