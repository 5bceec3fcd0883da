//! Beds: scenes of sub-particles at rest, from which timed runs start.

use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use glam::{DQuat, DVec3};
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::scene::{BodyKind, Placement, Scene};
use roost_solver::engine::state::State;
use roost_solver::equipment::{Surface, SurfaceKind};
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario};
use roost_solver::shape::lattice::{LatticeBond, MetaParticle};
use roost_solver::{Limits, check};
use roost_terminal::BadInput;
use serde_json::{Value, json};

/// The built-in beds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum BedKind {
    /// Single spheres that have fallen into a box
    Loose,
    /// Fillets that have settled in the hopper; the belt stands still
    Bonded,
    /// Fillets in the hopper while the belt runs and the hopper discharges
    Hopper,
}

impl BedKind {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Loose => "loose",
            Self::Bonded => "bonded",
            Self::Hopper => "hopper",
        }
    }
}

/// A scene of bodies at rest.
pub(super) struct Bed {
    pub(super) name: String,
    pub(super) scene: Scene,
    /// Whether the belt runs.
    pub(super) belt_runs: bool,
    /// Simulated time before the first timed turn, in seconds.
    pub(super) warm_up_s: f64,
    /// Whether the bed was simulated in this process: a timed run then reuses memory that the simulation has freed.
    pub(super) is_simulated: bool,
}

/// Simulated time for settling, in seconds.
const SETTLE_S: f64 = 1.2;
/// Steps before the first timed turn on a bed from a file; the comparison with LAMMPS uses the same number.
const WARM_UP_STEPS: f64 = 100.0;
/// Inner width of the box of 41,000 spheres, in radii.
const BOX_R: f64 = 120.0;
/// Spacing of the spheres before they fall, in radii.
const SPACING_R: f64 = 2.25;
/// Minimum width of the hopper, in metres: the widest fillet fits in.
const MIN_WIDTH_M: f64 = 0.12;
/// Density of spheres if the scenario gives none for sub-particles, in kg/m³.
const TISSUE_KG_M3: f64 = 940.0;

impl Bed {
    /// A bed that has settled; remaining velocities are set to zero.
    pub(super) fn settled(
        kind: BedKind,
        scenario: &Scenario,
        subparticles: u64,
        threads: usize,
    ) -> Result<Self> {
        // Settling may use larger steps than the timed turns.
        let with_large_steps = with_field(scenario, "numerics", "timestep_s", json!("auto"));
        let start = match kind {
            BedKind::Loose => loose(&with_large_steps, subparticles)?,
            BedKind::Bonded | BedKind::Hopper => fillets(&with_large_steps, subparticles)?,
        };
        let cpu = Cpu::new(threads);
        let mut run = cpu.prepare(&start);
        let done = cpu.advance(&mut [(&mut run, (SETTLE_S / start.timestep_s) as u64)]);
        if let Some(fault) = done.into_iter().find_map(|done| done.fault) {
            bail!("the bed {} diverged while it settled: {fault}", kind.name());
        }
        let timestep_s = scene_of(scenario)?.timestep_s;
        let bonds = cpu.bonds(&mut run);
        let scene = Scene { timestep_s, ..settled_scene(&start, cpu.state(&mut run), &bonds) };
        let belt_runs = kind == BedKind::Hopper;
        let warm_up_s = if belt_runs { 0.5 } else { 0.02 };
        Ok(Self { name: kind.name().to_owned(), scene, belt_runs, warm_up_s, is_simulated: true })
    }

    /// A bed from a file, in an open box that fits around it.
    pub(super) fn read(file: &Path, bonds: Option<&Path>, scenario: &Scenario) -> Result<Self> {
        let rows = read_numbers::<4>(file)?;
        let points: Vec<DVec3> = rows.iter().map(|[_, x, y, z]| DVec3::new(*x, *y, *z)).collect();
        if points.is_empty() {
            return Err(BadInput(format!(
                "{}: has no sub-particle; write a line `id x y z` for each",
                file.display()
            ))
            .into());
        }
        let mut pairs = Vec::new();
        for row in bonds.map_or_else(|| Ok(Vec::new()), read_numbers::<2>)? {
            let [i, j] = row.map(|number| number as usize);
            let is_whole = row.iter().all(|number| number.fract() == 0.0);
            if !is_whole || i == 0 || j == 0 || i == j || i.max(j) > points.len() {
                let text = format!(
                    "bond {} {}: must join two of the sub-particles 1 to {}",
                    row[0],
                    row[1],
                    points.len()
                );
                return Err(BadInput(text).into());
            }
            let [i, j] = [i.min(j) - 1, i.max(j) - 1].map(|number| number as u32);
            pairs.push(LatticeBond { i, j, class: 1 });
        }
        let base = scene_of(scenario)?;
        let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min) - base.radius_m;
        let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max) + base.radius_m;
        let name =
            file.file_stem().map_or_else(|| "bed".to_owned(), |stem| stem.to_string_lossy().into_owned());
        let subparticle_mass_kg = sphere_kg(scenario);
        let kinds = bodies(&points, &pairs).into_iter();
        let kinds = kinds.map(|(centre, meta)| (centre, BodyKind { meta, subparticle_mass_kg })).collect();
        let scene = with_bodies(in_open_box(base, low, high), kinds);
        let warm_up_s = WARM_UP_STEPS * scene.timestep_s;
        Ok(Self { name, scene, belt_runs: false, warm_up_s, is_simulated: false })
    }

    /// Writes the positions and the bonds to files.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        let state = State::new(&self.scene);
        let (mut positions, mut bonds) = (String::new(), String::new());
        for i in 0..state.particles.len() {
            let DVec3 { x, y, z } = state.position(i);
            writeln!(positions, "{} {x:.9} {y:.9} {z:.9}", i + 1)?;
        }
        let mut first = 1;
        for body in &self.scene.bodies {
            let meta = &self.scene.kinds[body.kind].meta;
            for bond in &meta.bonds {
                writeln!(bonds, "{} {}", first + bond.i, first + bond.j)?;
            }
            first += meta.points.len() as u32;
        }
        std::fs::create_dir_all(folder)?;
        for (name, text) in
            [(format!("{}.csv", self.name), positions), (format!("{}_bonds.csv", self.name), bonds)]
        {
            let path = folder.join(name);
            std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }

    pub(super) fn subparticles(&self) -> usize {
        self.scene.bodies.iter().map(|body| self.scene.kinds[body.kind].meta.points.len()).sum()
    }

    /// A run that has warmed up.
    pub(super) fn warmed_up_run<B: Backend>(&self, backend: &B) -> B::Run {
        self.warmed_up_runs(backend, 1).swap_remove(0)
    }

    /// Runs that have warmed up together.
    pub(super) fn warmed_up_runs<B: Backend>(&self, backend: &B, count: u16) -> Vec<B::Run> {
        let mut runs: Vec<B::Run> = (0..count).map(|_| backend.prepare(&self.scene)).collect();
        if self.belt_runs {
            runs.iter_mut().for_each(|run| backend.start(run));
        }
        let steps = (self.warm_up_s / self.scene.timestep_s).round() as u64;
        backend.advance(&mut runs.iter_mut().map(|run| (run, steps)).collect::<Vec<_>>());
        runs
    }
}

/// Mass of a single sphere of a scenario, in kilograms.
fn sphere_kg(scenario: &Scenario) -> f64 {
    let density = scenario.product.subparticle_density_kg_m3.unwrap_or(TISSUE_KG_M3);
    density * 4.0 / 3.0 * std::f64::consts::PI * scenario.product.radius_m().powi(3)
}

/// Spheres near the points of a grid over the floor of a box.
fn loose(scenario: &Scenario, count: u64) -> Result<Scene> {
    let base = scene_of(scenario)?;
    let radius = base.radius_m;
    // The same ratio of depth to width for every number of spheres.
    let side = BOX_R * radius * (count as f64 / 41_000.0).cbrt();
    let spacing = SPACING_R * radius;
    let columns = (side / spacing).floor() as u64;
    let mut random = fastrand::Rng::with_seed(1);
    let mut offset = || (random.f64() - 0.5) * 0.2 * radius;
    let place = |k: u64| {
        let [i, j, l] = [k % columns, k / columns % columns, k / (columns * columns)];
        DVec3::new(i as f64 + 0.5, j as f64 + 0.5, l as f64 + 0.5) * spacing
    };
    let points: Vec<DVec3> =
        (0..count).map(|k| place(k) + DVec3::new(offset(), offset(), offset())).collect();
    let high = points.iter().copied().fold(DVec3::splat(side), DVec3::max);
    let one = BodyKind { meta: meta(&[DVec3::ZERO], Vec::new()), subparticle_mass_kg: sphere_kg(scenario) };
    let placement =
        |position| Placement { kind: 0, position, orientation: DQuat::IDENTITY, velocity: DVec3::ZERO };
    let bodies = sorted_by_cell(points).into_iter().map(placement).collect();
    Ok(Scene { kinds: vec![one], bodies, ..in_open_box(base, DVec3::ZERO, high) })
}

/// Spheres sorted by cells of 6 × 6 × 6, so that consecutive spheres are near each other.
fn sorted_by_cell(mut points: Vec<DVec3>) -> Vec<DVec3> {
    let spacing = points.get(1).map_or(1.0, |second| second.distance(points[0]));
    let cell = |point: &DVec3| (*point / (6.0 * spacing)).floor().as_ivec3().to_array();
    points.sort_by_key(cell);
    points
}

/// Fillets with about this number of sub-particles in all, in a hopper of proportional width.
fn fillets(scenario: &Scenario, subparticles: u64) -> Result<Scene> {
    let whole = scene_of(scenario)?;
    let of_whole: usize = whole.bodies.iter().map(|body| whole.kinds[body.kind].meta.points.len()).sum();
    let count = f64::from(scenario.product.count) * subparticles as f64 / of_whole as f64;
    let width = scenario.equipment().map_or(0.59, |equipment| equipment.hopper_width_m) * count
        / f64::from(scenario.product.count);
    let narrow = with_field(scenario, "equipment", "hopper_width_m", json!(width.clamp(MIN_WIDTH_M, 10.0)));
    let few = with_field(&narrow, "product", "count", json!((count.round() as u64).max(1)));
    scene_of(&few)
}

/// The scene of a scenario without meshes.
fn scene_of(scenario: &Scenario) -> Result<Scene> {
    let checked = check(scenario, &Meshes::default(), &Limits::NONE)
        .map_err(|faults| BadInput(faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")))?;
    Ok(checked.setup().scene().clone())
}

/// The scenario with another value of a field.
fn with_field(scenario: &Scenario, section: &str, field: &str, value: Value) -> Scenario {
    let mut document = json!(scenario);
    document[section][field] = value;
    scenario::from_value(&document).expect("a valid scenario")
}

/// The scene with its surfaces replaced by a box that is open at the top.
fn in_open_box(base: Scene, low: DVec3, high: DVec3) -> Scene {
    let size = high - low;
    let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
    let plate = |name: &str, corner, u, v| Surface::parallelogram(name, SurfaceKind::Equipment, corner, u, v);
    let surfaces = vec![
        plate("floor", low, x, y),
        plate("left", low, x, z),
        plate("right", low + y, x, z),
        plate("back", low, y, z),
        plate("front", low + x, y, z),
    ];
    let margin = DVec3::splat(0.05);
    Scene { surfaces, low: low - margin, high: high + margin, periodic_y: false, held: Vec::new(), ..base }
}

fn meta(points: &[DVec3], bonds: Vec<LatticeBond>) -> Arc<MetaParticle> {
    let bounding_radius_m = points.iter().map(|point| point.length()).fold(0.0, f64::max);
    Arc::new(MetaParticle { points: points.to_vec(), bonds, volume_m3: 0.0, bounding_radius_m })
}

/// Connected components of the bonds as bodies: centre and sub-particles around it, ordered by their first sub-particle.
fn bodies(points: &[DVec3], bonds: &[LatticeBond]) -> Vec<(DVec3, Arc<MetaParticle>)> {
    let mut first: Vec<usize> = (0..points.len()).collect();
    fn root(first: &mut [usize], mut at: usize) -> usize {
        while first[at] != at {
            first[at] = first[first[at]];
            at = first[at];
        }
        at
    }
    for bond in bonds {
        let (a, b) = (root(&mut first, bond.i as usize), root(&mut first, bond.j as usize));
        first[a.max(b)] = a.min(b);
    }
    let mut found: Vec<(Vec<DVec3>, Vec<LatticeBond>)> = Vec::new();
    let mut number_of: HashMap<usize, usize> = HashMap::new();
    let mut local = vec![(0, 0); points.len()];
    for (k, point) in points.iter().enumerate() {
        let body = *number_of.entry(root(&mut first, k)).or_insert_with(|| {
            found.push(Default::default());
            found.len() - 1
        });
        local[k] = (body, found[body].0.len() as u32);
        found[body].0.push(*point);
    }
    for bond in bonds {
        let ((body, i), (_, j)) = (local[bond.i as usize], local[bond.j as usize]);
        found[body].1.push(LatticeBond { i, j, class: bond.class });
    }
    let components = found.into_iter().map(|(points, mut bonds)| {
        bonds.sort_unstable();
        let centre = points.iter().sum::<DVec3>() / points.len() as f64;
        let points: Vec<DVec3> = points.iter().map(|point| point - centre).collect();
        (centre, meta(&points, bonds))
    });
    components.collect()
}

/// The scene with its bodies replaced by these, given by centre and kind.
fn with_bodies(scene: Scene, bodies: Vec<(DVec3, BodyKind)>) -> Scene {
    let (mut kinds, mut placements) = (Vec::new(), Vec::new());
    for (position, kind) in bodies {
        placements.push(Placement {
            kind: kinds.len(),
            position,
            orientation: DQuat::IDENTITY,
            velocity: DVec3::ZERO,
        });
        kinds.push(kind);
    }
    Scene { kinds, bodies: placements, ..scene }
}

/// A scene at rest with the positions of a state. Contact histories are dropped, and fragments become bodies: `bonds` are the
/// intact ones.
fn settled_scene(scene: &Scene, state: &State, bonds: &[[u32; 2]]) -> Scene {
    let intact: HashSet<[u32; 2]> = bonds.iter().copied().collect();
    let fragments = state.body_ranges().flat_map(|(number, range)| {
        let BodyKind { meta, subparticle_mass_kg } = scene.kinds[scene.bodies[number as usize].kind].clone();
        let serial = |number: u32| state.serials[range.start + number as usize];
        let is_intact = |bond: &&LatticeBond| intact.contains(&[serial(bond.i), serial(bond.j)]);
        let bonds: Vec<LatticeBond> = meta.bonds.iter().filter(is_intact).copied().collect();
        let points: Vec<DVec3> = range.clone().map(|i| state.position(i)).collect();
        bodies(&points, &bonds)
            .into_iter()
            .map(move |(centre, meta)| (centre, BodyKind { meta, subparticle_mass_kg }))
    });
    with_bodies(scene.clone(), fragments.collect())
}

/// Reads lines of N numbers.
fn read_numbers<const N: usize>(file: &Path) -> Result<Vec<[f64; N]>> {
    let text = std::fs::read_to_string(file)
        .map_err(|error| BadInput(format!("cannot read {}: {error}", file.display())))?;
    let mut rows = Vec::new();
    for (line, text) in text.lines().enumerate().filter(|(_, text)| !text.trim().is_empty()) {
        let words = text.split([' ', ',', '\t']).filter(|word| !word.is_empty());
        let row: Option<Vec<f64>> =
            words.map(|word| word.parse().ok().filter(|number: &f64| number.is_finite())).collect();
        let row = row.and_then(|row| row.try_into().ok()).ok_or_else(|| {
            BadInput(format!("{}, line {}: must be {N} numbers, found \"{text}\"", file.display(), line + 1))
        })?;
        rows.push(row);
    }
    Ok(rows)
}
