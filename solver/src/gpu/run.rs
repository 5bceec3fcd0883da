//! One run: its buffers on the device, its data in main memory, and access for observers.

use glam::{IVec3, UVec3, Vec3};

use super::device::Device;
use super::layout::{Count, Moments, NONE, Particle, Pose, PrivateState, Scene, WallPair};
use super::neighbour_list::Rows;
use super::run_buffers::{ElementCounts, RunBuffer, RunBuffers, RunContents};
use super::unwind;
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
    /// Buffer to read back into, and the submission after which it has what observers read.
    pub(super) staging: Option<wgpu::Buffer>,
    pub(super) read_back: Option<wgpu::SubmissionIndex>,
    walls: Walls,
    dt: f64,
    state: State,
    touches: Vec<Touch>,
    /// Whether `state` and `touches` are those of the device.
    is_read: bool,
}

/// A contact with a facet in the last step.
#[derive(Clone, Copy, Debug)]
struct Touch {
    particle: usize,
    facet: u32,
    /// On the sub-particle, in N.
    force: Vec3,
}

impl Touch {
    /// The contact of a sub-particle with a facet near it, if it bore a force.
    fn of(particle: usize, wall: &WallPair) -> Option<Self> {
        let force = Vec3::from(wall.force);
        (force != Vec3::ZERO).then_some(Self { particle, facet: wall.facet, force })
    }
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
            staging: None,
            read_back: None,
            touches: Vec::new(),
            walls,
            dt: scene.timestep_s,
            state,
            is_read: true,
        };
        run.write_state(device);
        Ok(run)
    }

    pub(super) fn write_state(&self, device: &Device) {
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

    /// Load on each surface in the last step, summed in the order of the plain path. Contacts without a force add nothing.
    pub(super) fn surface_loads(&mut self, device: &Device) -> Vec<SurfaceLoad> {
        self.read(device);
        let contact = |touch: &Touch| (self.state.particles[touch.particle], touch.facet, touch.force);
        self.walls.loads(&self.state.frame, self.dt as f32, self.touches.iter().map(contact))
    }

    /// Makes a buffer to read back into, unless it has one.
    pub(super) fn make_staging(&mut self, device: &Device) -> Result<(), OutOfDeviceMemory> {
        let bytes = self.buffers.observed_bytes();
        if self.staging.as_ref().is_none_or(|staging| staging.size() < bytes) {
            self.staging = None;
            self.staging = Some(device.staging(bytes)?);
        }
        Ok(())
    }

    /// Reads the data for observers, unless it is current. The last chunk has sent them on their way: a transfer of its own
    /// would wait for the chunks of other runs.
    fn read(&mut self, device: &Device) {
        if self.is_read || self.buffers.observed_bytes() == 0 {
            return;
        }
        let submitted = self.read_back.take();
        self.make_staging(device).unwrap_or_else(|out_of_memory| unwind(out_of_memory));
        let staging = self.staging.take().expect("it was made");
        let submitted = submitted.unwrap_or_else(|| self.buffers.read_back(device, &staging));
        let sizes = RunBuffer::OBSERVED.map(|part| self.buffers.bytes(part) as usize);
        device.with_mapped(&staging, submitted, |mut rest| {
            self.take_in(sizes.map(|bytes| rest.split_off(..bytes).expect("it was copied")));
        });
        self.staging = Some(staging);
        self.is_read = true;
    }

    /// Takes in the bytes of the buffers that observers read.
    fn take_in(&mut self, [particles, own, counts, walls]: [&[u8]; 4]) {
        let particles: &[Particle] = bytemuck::cast_slice(particles);
        let own: &[PrivateState] = bytemuck::cast_slice(own);
        let (counts, walls): (&[Count], &[WallPair]) =
            (bytemuck::cast_slice(counts), bytemuck::cast_slice(walls));
        for (to, from) in self.state.particles.iter_mut().zip(particles) {
            to.position = IVec3::from(from.position);
            to.velocity = Vec3::from(from.velocity);
            to.spin = Vec3::from(from.spin);
        }
        for (k, own) in own.iter().enumerate() {
            self.state.remainders[k] = Vec3::from(own.remainder);
            self.state.broken[k] = own.broken;
        }
        self.state.bonds_broken = self.bonds_broken;
        self.touches.clear();
        for (particle, count) in counts.iter().enumerate() {
            let near = walls[particle..].iter().step_by(counts.len()).take(count.walls as usize);
            self.touches.extend(near.filter_map(|wall| Touch::of(particle, wall)));
        }
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
            self.touches
                .retain(|touch| !changed.iter().any(|[first, last]| (*first..=*last).contains(&touch.facet)));
            self.buffers.write_rows(device, &rows);
        }
    }

    /// Forgets sub-particles in main memory. Returns the new index of each sub-particle, or [`NONE`].
    pub(super) fn forget(&mut self, device: &Device, serials: &[u32]) -> Vec<u32> {
        self.read(device);
        let map = self.state.remove(serials);
        self.touches.retain_mut(|touch| {
            let to = map[touch.particle];
            touch.particle = to as usize;
            to != NONE
        });
        map
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
