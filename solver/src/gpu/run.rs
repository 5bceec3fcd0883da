//! One run: its buffers on the device, its data in main memory, and access for observers.

use bytemuck::pod_collect_to_vec;
use glam::{IVec3, UVec3, Vec3};

use super::device::Device;
use super::layout::{Count, Moments, Particle, Pose, PrivateState, Scene, WallPair};
use super::neighbour_list::Rows;
use super::run_buffers::{ElementCounts, RunBuffer, RunBuffers, RunContents};
use super::walls::{Geometry, poses};
use crate::cpu::SKIN_RATIO;
use crate::engine::saved::SavedRun;
use crate::engine::scene;
use crate::engine::state::State;
use crate::engine::{OutOfDeviceMemory, SurfaceLoad};
use crate::physics::InternalLaws;
use crate::walls::Walls;

/// Initial number of steps between two rebuilds of the lists.
const INITIAL_INTERVAL: u32 = 8;

/// A run on the device. The driver owns it while it is being advanced.
#[derive(Debug)]
pub struct GpuRun(pub(super) Option<Box<Run>>);

impl GpuRun {
    pub(super) fn new(run: Run) -> Self {
        Self(Some(Box::new(run)))
    }

    /// The run.
    ///
    /// # Panics
    /// If it was lost: it did not fit, or the device failed.
    pub(super) fn get(&mut self) -> &mut Run {
        self.0.as_mut().expect("it was not lost")
    }

    /// Capacity of a row of facets. Rows grow when a sub-particle has more facets near it.
    pub fn wall_capacity(&mut self) -> u32 {
        self.get().buffers.row_capacity.walls
    }
}

/// Data of a run.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) buffers: RunBuffers,
    /// Its parameters. A batch fills in the offsets of its buffers.
    pub(super) scene: Scene,
    /// Estimated steps between two rebuilds of its lists.
    pub(super) interval: u32,
    pub(super) fault: Option<String>,
    pub(super) step: u64,
    pub(super) start_step: Option<u64>,
    pub(super) speed_limit: f32,
    pub(super) bonds_broken: u64,
    walls: Walls,
    dt: f64,
    state: State,
    surface_loads: Vec<SurfaceLoad>,
    /// Whether `state` and `surface_loads` are those of the device.
    is_read: bool,
}

impl Run {
    /// Takes in a scene; `make` creates its buffers.
    pub(super) fn new(
        device: &Device,
        scene: &scene::Scene,
        make: impl FnOnce(RunContents) -> Result<RunBuffers, OutOfDeviceMemory>,
    ) -> Result<Self, OutOfDeviceMemory> {
        Self::with(device, scene, State::new(scene), Rows::new(scene), make)
    }

    /// A run of a scene that goes on from there.
    pub(super) fn restore(
        device: &Device,
        scene: &scene::Scene,
        saved: &SavedRun,
        make: impl FnOnce(RunContents) -> Result<RunBuffers, OutOfDeviceMemory>,
    ) -> Result<Self, OutOfDeviceMemory> {
        let rows = Rows::restore(saved, scene.laws.moment.is_some());
        let mut run = Self::with(device, scene, saved.state.clone(), rows, make)?;
        run.walls.restore(saved.start_step, saved.step, run.dt, &run.state.frame);
        if saved.start_step.is_some() {
            run.buffers.write_geometry(device, &Geometry::new(&run.walls));
        }
        (run.step, run.start_step, run.bonds_broken) =
            (saved.step, saved.start_step, saved.state.bonds_broken);
        // The loads of the last step are on the device.
        run.is_read = false;
        Ok(run)
    }

    fn with(
        device: &Device,
        scene: &scene::Scene,
        state: State,
        rows: Rows,
        make: impl FnOnce(RunContents) -> Result<RunBuffers, OutOfDeviceMemory>,
    ) -> Result<Self, OutOfDeviceMemory> {
        let walls = Walls::new(scene, &state.frame);
        let geometry = Geometry::new(&walls);
        let own = shared_scene(scene, &state);
        let elements = ElementCounts {
            scenes: 1,
            particles: state.particles.len() as u32,
            moments: if scene.laws.moment.is_some() { state.particles.len() as u32 } else { 0 },
            surfaces: geometry.surfaces.len() as u32,
            facets: geometry.facets.len() as u32,
            corners: geometry.corners.len() as u32,
            nodes: geometry.nodes.len() as u32,
            leaves: geometry.leaves.len() as u32,
            cells: (UVec3::from(own.mask) + 1).element_product(),
            poses: 0,
        };
        let run = Self {
            buffers: make(RunContents { elements, geometry, rows })?,
            scene: own,
            interval: INITIAL_INTERVAL,
            fault: None,
            step: 0,
            start_step: None,
            speed_limit: scene.speed_limit_m_s as f32,
            bonds_broken: 0,
            surface_loads: vec![SurfaceLoad::default(); walls.surface_count()],
            walls,
            dt: scene.timestep_s,
            state,
            is_read: true,
        };
        run.write_state(device);
        Ok(run)
    }

    fn write_state(&self, device: &Device) {
        let state = &self.state;
        let particles = state.particles.iter().zip(&state.masses).zip(&state.held).zip(&state.bodies);
        let particles: Vec<Particle> = particles
            .map(|(((particle, &mass), &held), &body)| Particle {
                position: particle.position.to_array(),
                held: u32::from(held),
                velocity: particle.velocity.to_array(),
                mass,
                spin: particle.spin.to_array(),
                body,
            })
            .collect();
        let own = state.remainders.iter().zip(&state.broken);
        let own: Vec<PrivateState> = own
            .map(|(remainder, &broken)| PrivateState { remainder: remainder.to_array(), broken })
            .collect();
        self.buffers.write(device, RunBuffer::Particles, &particles);
        self.buffers.write(device, RunBuffer::PrivateState, &own);
    }

    /// The state.
    pub(super) fn state(&mut self, device: &Device) -> &State {
        self.read(device);
        &self.state
    }

    /// Load on each surface in the last step.
    pub(super) fn surface_loads(&mut self, device: &Device) -> Vec<SurfaceLoad> {
        self.read(device);
        self.surface_loads.clone()
    }

    /// Reads the data for observers, unless it is current. One transfer for all: other runs may keep the
    /// device busy.
    fn read(&mut self, device: &Device) {
        if !self.is_read {
            let parts = [RunBuffer::Particles, RunBuffer::PrivateState, RunBuffer::Counts, RunBuffer::Walls];
            let [particles, own, counts, walls] = self.buffers.read(device, parts);
            let particles: Vec<Particle> = pod_collect_to_vec(&particles);
            let own: Vec<PrivateState> = pod_collect_to_vec(&own);
            for (to, from) in self.state.particles.iter_mut().zip(&particles) {
                to.position = IVec3::from(from.position);
                to.velocity = Vec3::from(from.velocity);
                to.spin = Vec3::from(from.spin);
            }
            for (k, own) in own.iter().enumerate() {
                self.state.remainders[k] = Vec3::from(own.remainder);
                self.state.broken[k] = own.broken;
            }
            self.state.bonds_broken = self.bonds_broken;
            let (counts, walls): (Vec<Count>, Vec<WallPair>) =
                (pod_collect_to_vec(&counts), pod_collect_to_vec(&walls));
            let near = |i: usize| walls[i..].iter().step_by(counts.len()).take(counts[i].walls as usize);
            self.surface_loads = self.loads(near);
            self.is_read = true;
        }
    }

    /// Load on each surface, summed in the order of the plain path.
    fn loads<'a, Near: Iterator<Item = &'a WallPair>>(
        &self,
        near: impl Fn(usize) -> Near,
    ) -> Vec<SurfaceLoad> {
        let contacts = self.state.particles.iter().enumerate().flat_map(|(i, particle)| {
            near(i).map(|wall| (*particle, wall.facet, Vec3::from(wall.force)))
        });
        self.walls.loads(&self.state.frame, self.dt as f32, contacts)
    }

    /// Counts steps done on the device.
    pub(super) fn steps_done(&mut self, steps: u64) {
        self.is_read = false;
        self.step += steps;
    }

    pub(super) fn bonds(&self, device: &Device) -> Vec<[u32; 2]> {
        let rows = self.buffers.read_rows(device);
        rows.bonds().map(|[i, j]| [self.state.serials[i], self.state.serials[j]]).collect()
    }

    pub(super) fn save(&mut self, device: &Device) -> SavedRun {
        self.read(device);
        let rows = self.buffers.read_rows(device);
        SavedRun {
            step: self.step,
            start_step: self.start_step,
            state: self.state.clone(),
            stored_bodies: Vec::new(),
            pairs: rows.save_pairs(),
            walls: rows.save_walls(),
        }
    }

    pub(super) fn start(&mut self, device: &Device) {
        self.start_step = Some(self.step);
        let changed = self.walls.start();
        self.buffers.write_geometry(device, &Geometry::new(&self.walls));
        if !changed.is_empty() {
            self.state(device);
            let mut rows = self.buffers.read_rows(device);
            rows.surfaces_changed(&changed);
            self.surface_loads = self.loads(|i| rows.walls(i).iter());
            self.buffers.write_rows(device, &rows);
        }
    }

    pub(super) fn remove(&mut self, device: &Device, serials: &[u32]) {
        self.state(device);
        let rows = self.buffers.read_rows(device);
        let map = self.state.remove(serials);
        let rows = rows.remove(&map);
        self.surface_loads = self.loads(|i| rows.walls(i).iter());
        self.buffers.write_rows(device, &rows);
        self.write_state(device);
    }

    pub(super) fn enter(
        &mut self,
        device: &Device,
        scene: &scene::Scene,
        first: usize,
        bodies: &[scene::Placement],
    ) -> Result<(), OutOfDeviceMemory> {
        self.state(device);
        let rows = self.buffers.read_rows(device).with_bodies(scene, bodies);
        self.state.enter(scene, first, bodies);
        self.buffers.make_room(device, &rows)?;
        self.buffers.write_rows(device, &rows);
        self.write_state(device);
        Ok(())
    }

    /// Poses of its surfaces in each of the next steps; once while all stand still.
    pub(super) fn poses(&mut self, steps: u64) -> Vec<Pose> {
        let count = if self.moves() { steps } else { 1 };
        let mut all = Vec::new();
        for step in self.step..self.step + count {
            let belt_time = self.start_step.map(|start| (step - start) as f64 * self.dt);
            self.walls.pose(belt_time, &self.state.frame);
            all.extend(poses(&self.walls));
        }
        all
    }

    /// Whether any of its surfaces moves.
    pub(super) fn moves(&self) -> bool {
        self.start_step.is_some() && self.walls.max_speed() > 0.0
    }

    /// Steps in which a surface moves by at most half the skin.
    pub(super) fn max_interval(&self) -> u32 {
        if !self.moves() {
            return u32::MAX;
        }
        // Plus one, since lists are built for the poses of the first step; minus one for rounding.
        (f64::from(self.scene.half_skin) / (self.walls.max_speed() * self.dt)) as u32
    }
}

/// The parameters of a scene for the kernels.
fn shared_scene(scene: &scene::Scene, state: &State) -> Scene {
    let (radius, laws, frame) = (scene.radius_m as f32, &scene.laws, &state.frame);
    let InternalLaws { contacts, bond, moment, contact_between_bonded } = laws.internal(radius);
    let [(tissue, contact_distance), (body_tissue, body_contact_distance)] = contacts;
    let (skin, limit) = (SKIN_RATIO * radius, scene.speed_limit_m_s as f32);
    let [cutoff, body_cutoff] = contacts.map(|(law, distance)| distance + law.adhesion_range() + skin);
    let cell = (body_cutoff / frame.unit_m).ceil() as u32 + 1;
    Scene {
        gravity: scene.gravity.as_vec3().to_array(),
        dt: scene.timestep_s as f32,
        mask: mask(scene, state, cell).to_array(),
        radius,
        unit_m: frame.unit_m,
        inverse_unit: 1.0 / frame.unit_m,
        spin_factor: 2.5 / (radius * radius),
        limit2: limit * limit,
        contact_distance,
        body_contact_distance,
        cutoff,
        body_cutoff,
        wall_cutoff: radius + laws.adhesion_range() + skin,
        half_skin: skin / 2.0,
        period_y: frame.period_y,
        cell,
        contact_between_bonded: u32::from(contact_between_bonded),
        moment: moment.as_ref().map(Moments::from).unwrap_or_default(),
        bond: (&bond).into(),
        tissue: (&tissue).into(),
        body_tissue: (&body_tissue).into(),
        ..Scene::default()
    }
}

/// Maximum number of cells of a cell list.
pub(super) fn max_cells(particles: u32) -> u32 {
    4 * particles.next_power_of_two().max(1024)
}

/// Cells of the cell list per direction, minus one: enough for the domain, up to the maximum.
fn mask(scene: &scene::Scene, state: &State, cell: u32) -> UVec3 {
    let edge = f64::from(cell) * f64::from(state.frame.unit_m);
    let limit = max_cells(state.particles.len() as u32);
    let wanted = ((scene.high - scene.low) / edge).as_uvec3().clamp(UVec3::splat(3), UVec3::splat(1 << 20));
    let mut cells = UVec3::from(wanted.to_array().map(|count| (count + 1).next_power_of_two()));
    let product = |cells: UVec3| cells.to_array().map(u64::from).iter().product::<u64>();
    while product(cells) > u64::from(limit) {
        let axis = cells.max_position();
        cells[axis] /= 2;
    }
    cells - 1
}
