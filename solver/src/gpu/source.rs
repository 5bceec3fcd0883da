//! The WGSL of the kernels, assembled from its files: types and constants from Rust, terms, stages.

use crate::gpu::layout;
use crate::physics::bond::{BondModel, NO_LENGTH_M, STRETCH_CLAMP};
use crate::physics::damping;
use crate::physics::jkr::{CURVATURE, D_SNAP, X_SNAP};
use crate::walls::{ALIGNED_COSINE, ALIGNED_SINE, COINCIDENT_M, EDGE_TOLERANCE, OFF_FACET};

/// Names and texts of WGSL files.
macro_rules! files {
    ($($name:literal),* $(,)?) => { [$(($name, include_str!(concat!("kernels/", $name, ".wgsl")))),*] };
}

/// The terms: pure functions, each the twin of a Rust file.
const TERMS: [(&str, &str); 10] = files![
    "vector",
    "frame",
    "damping",
    "hertz",
    "jkr",
    "friction",
    "contact",
    "bond",
    "moment",
    "integrate"
];

/// The stages, which bind buffers.
const STAGES: [(&str, &str); 9] =
    files!["bindings", "cell_list", "pair_list", "walls", "wall_list", "side", "forces", "step", "remove"];

/// The source of the kernels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    files: Vec<(&'static str, String)>,
}

impl Source {
    /// All files.
    pub fn kernels() -> Self {
        let mut source = Self::terms();
        source.files.extend(STAGES.map(|(name, text)| (name, text.to_owned())));
        source
    }

    /// Only the terms, with their types.
    pub fn terms() -> Self {
        let nearest = include_str!("kernels/nearest.wgsl");
        let mut files = vec![("layout", layout::declarations()), ("constants", constants())];
        files.extend(TERMS.map(|(name, text)| (name, text.to_owned())));
        files.push(("nearest", ["f32", "f64"].map(|real| nearest.replace("REAL", real)).concat()));
        Self { files }
    }

    /// Replaces text in one of its files, for tests that must fail. `from` must be present.
    pub fn with(mut self, name: &str, from: &str, to: &str) -> Self {
        let (_, text) = self.files.iter_mut().find(|file| file.0 == name).expect("a file of that name");
        assert!(text.contains(from), "{name} does not say {from}");
        *text = text.replacen(from, to, 1);
        self
    }

    /// The whole text, followed by `more`.
    pub fn text(&self, more: &str) -> String {
        self.files.iter().map(|(_, text)| text.as_str()).chain([more]).collect::<Vec<_>>().join("\n")
    }
}

/// Constants taken from Rust.
fn constants() -> String {
    let floats = [
        ("D_SNAP", D_SNAP),
        ("X_SNAP", X_SNAP),
        ("CURVATURE", CURVATURE),
        ("STRETCH_CLAMP", STRETCH_CLAMP),
        ("NO_LENGTH_M", NO_LENGTH_M),
        ("MOMENT_CAP", damping::MOMENT_CAP),
        ("COINCIDENT_M", COINCIDENT_M),
        ("EDGE_TOLERANCE", EDGE_TOLERANCE),
        ("ALIGNED_COSINE", ALIGNED_COSINE),
        ("ALIGNED_SINE", ALIGNED_SINE),
        ("OFF_FACET_SHARE", OFF_FACET),
    ];
    // Damping caps along n and across it.
    let pairs = [
        ("BONDED_CAP", damping::BONDED_CAP),
        ("BODY_CAP", damping::BODY_CAP),
        ("SURFACE_CAP", damping::SURFACE_CAP),
    ];
    let numbers = [
        ("COROTATED", layout::bond_model(BondModel::Corotated)),
        ("AS_PUBLISHED", layout::bond_model(BondModel::AsPublished)),
        ("FINITE_EXTENSION", layout::bond_model(BondModel::FiniteExtension)),
        ("MAX_NEIGHBOURS", layout::MAX_NEIGHBOURS),
        ("IN_CONTACT", layout::IN_CONTACT),
        ("FROM_ABOVE", layout::FROM_ABOVE),
        ("FROM_BELOW", layout::FROM_BELOW),
        ("BEYOND", layout::BEYOND),
        ("ON_RIM", layout::ON_RIM),
        ("OFF_FACET", layout::OFF_FACET),
        ("ENTRY_SHIFT", layout::ENTRY_SHIFT),
        ("NONE", layout::NONE),
        ("GROUP_SIZE", super::pipelines::GROUP_SIZE),
        ("LANES", super::pipelines::LANES),
    ];
    let floats = floats.map(|(name, value)| format!("const {name}: f32 = {value:?}f;\n"));
    let pairs = pairs.map(|(name, cap)| {
        format!("const {name}: vec2<f32> = vec2({:?}f, {:?}f);\n", cap.normal, cap.tangential)
    });
    let numbers = numbers.map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
    floats.concat() + &pairs.concat() + &numbers.concat()
}
