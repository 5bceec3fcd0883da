//! The GPU backend held against the plain path, bit by bit.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses some of these")]

use glam::{IVec3, Vec3};
use roost_solver::cpu::{Cpu, CpuRun};
use roost_solver::engine::scene::Scene;
use roost_solver::engine::state::State;
use roost_solver::engine::{AdvanceReport, Backend};
use roost_solver::gpu::source::Source;
use roost_solver::gpu::{Device, Gpu, GpuOptions, GpuRun};

/// Opens Mesa's software adapter, which rounds every operation by itself, or the one that ROOST_GPU names. Tests without
/// one fail, unless ROOST_SKIP_GPU says that they may be left out.
pub fn device() -> Option<Device> {
    if std::env::var_os("ROOST_SKIP_GPU").is_some() {
        eprintln!("left out: ROOST_SKIP_GPU is set");
        return None;
    }
    let name = std::env::var("ROOST_GPU").unwrap_or_else(|_| "llvmpipe".to_owned());
    let options = GpuOptions { device: Some(name), allow_software: true, ..GpuOptions::default() };
    let fix =
        "`make needs` installs Mesa's; ROOST_GPU names another; ROOST_SKIP_GPU=1 leaves these tests out";
    Some(Device::open(&options).unwrap_or_else(|error| panic!("{error}: {fix}")))
}

/// The backend on that adapter.
pub fn gpu() -> Option<Gpu> {
    device().map(|device| Gpu::with(device, &Source::kernels()).expect("kernels that compile"))
}

/// The first bits in which two states differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The quantity that differs.
    pub what: &'static str,
    /// The first sub-particle of which it does.
    pub subparticle: usize,
    /// How many sub-particles differ in it.
    pub of: usize,
    /// The expected and the found values.
    pub values: String,
}

fn bits(v: Vec3) -> [u32; 3] {
    v.to_array().map(f32::to_bits)
}

/// Where two states differ, if they do.
pub fn difference(plain: &State, other: &State) -> Option<Difference> {
    assert_eq!(plain.serials, other.serials);
    let count = plain.particles.len();
    let differ = |what, is_other: &dyn Fn(usize) -> bool, values: &dyn Fn(usize) -> String| {
        let all: Vec<usize> = (0..count).filter(|&i| is_other(i)).collect();
        let first = *all.first()?;
        Some(Difference { what, subparticle: first, of: all.len(), values: values(first) })
    };
    let (p, q) = (&plain.particles, &other.particles);
    let (r, s) = (&plain.remainders, &other.remainders);
    differ("velocity", &|i| bits(p[i].velocity) != bits(q[i].velocity), &|i| {
        format!("{:?} {:?}", p[i].velocity, q[i].velocity)
    })
    .or_else(|| {
        differ("spin", &|i| bits(p[i].spin) != bits(q[i].spin), &|i| {
            format!("{:?} {:?}", p[i].spin, q[i].spin)
        })
    })
    .or_else(|| {
        let places: [&dyn Fn(usize) -> IVec3; 2] = [&|i| p[i].position, &|i| q[i].position];
        differ("position", &|i| places[0](i) != places[1](i), &|i| {
            format!("{} {}", places[0](i), places[1](i))
        })
    })
    .or_else(|| differ("remainder", &|i| bits(r[i]) != bits(s[i]), &|i| format!("{:?} {:?}", r[i], s[i])))
    .or_else(|| {
        let (b, c) = (&plain.broken, &other.broken);
        differ("broken bonds", &|i| b[i] != c[i], &|i| format!("{} {}", b[i], c[i]))
    })
}

/// A scene on both.
pub struct Both<'a> {
    pub plain: Cpu,
    pub gpu: &'a Gpu,
    pub plain_run: CpuRun,
    pub gpu_run: GpuRun,
}

impl<'a> Both<'a> {
    pub fn new(gpu: &'a Gpu, scene: &Scene) -> Self {
        let plain = Cpu::plain(1);
        Self { plain_run: plain.prepare(scene), gpu_run: gpu.prepare(scene), plain, gpu }
    }

    pub fn advance(&mut self, steps: u64) -> [AdvanceReport; 2] {
        let plain = self.plain.advance(&mut [(&mut self.plain_run, steps)]).swap_remove(0);
        let gpu = self.gpu.advance(&mut [(&mut self.gpu_run, steps)]).swap_remove(0);
        [plain, gpu]
    }

    /// Asserts that all that can be seen of the two is the same.
    #[track_caller]
    pub fn assert_same(&mut self) {
        let found = difference(self.plain.state(&mut self.plain_run), self.gpu.state(&mut self.gpu_run));
        assert_eq!(found, None);
        let plain = self.plain.surface_forces(&mut self.plain_run);
        assert_eq!(plain, self.gpu.surface_forces(&mut self.gpu_run));
        assert_eq!(self.plain.bonds(&mut self.plain_run), self.gpu.bonds(&mut self.gpu_run));
        let broken = self.plain.state(&mut self.plain_run).bonds_broken;
        assert_eq!(broken, self.gpu.state(&mut self.gpu_run).bonds_broken);
    }

    /// Advances both by `steps` in all, `at_once` at a time. Asserts that their states are equal and neither run fails.
    #[track_caller]
    pub fn assert_equal_for(&mut self, steps: u64, at_once: u64) {
        for k in 0..steps.div_ceil(at_once) {
            let [plain, gpu] = self.advance(at_once);
            let found = difference(self.plain.state(&mut self.plain_run), self.gpu.state(&mut self.gpu_run));
            assert_eq!(found, None, "within {at_once} steps after step {}", k * at_once);
            assert_eq!(plain, gpu);
            assert_eq!(plain.fault, None);
        }
        self.assert_same();
    }
}
