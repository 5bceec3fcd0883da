//! The device that computes runs: the CPU, or a graphics adapter. All runs of a worker share the adapter and its memory; it is opened again
//! after a failure.

use std::sync::{Arc, Mutex, PoisonError};

use roost_solver::result::RunResult;
use roost_solver::{Checked, Checkpoint, Computer, CpuOptions, Observer, SimulateError, Stamp};

use crate::memory_budget::{MemoryBudget, MemoryShare, PendingRun};

/// Default memory for runs on an adapter, in MiB: half of a common adapter's. wgpu does not report the memory of an adapter.
pub const DEFAULT_MEMORY_MIB: u32 = 4096;

/// Default of jobs at once on a GPU, as far as its memory allows. More would use a large GPU better, but other workers could not take these
/// jobs, and all of them are lost together.
pub(crate) const MAX_GPU_SLOTS: usize = 16;

/// The part of a machine's memory that its runs share: the rest is for everything else.
fn share_of_machine(mib: u32) -> u32 {
    (mib / 4 * 3).max(1)
}

/// Choice of the device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceOptions {
    /// None takes a discrete GPU, or the CPU without one. The speed of integrated GPUs was not measured.
    pub backend: Option<BackendKind>,
    /// Part of the adapter's name; none takes the first.
    pub adapter: Option<String>,
    /// Whether a software adapter counts as a GPU.
    pub allow_software: bool,
    /// MiB of the adapter's memory for runs; a larger run is refused. None lets runs share [`DEFAULT_MEMORY_MIB`], and tries a larger run alone.
    pub memory_mib: Option<u32>,
}

/// The size of a run, which determines its memory.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "adapters need more than the memory"))]
pub(crate) struct RunSize {
    /// Estimated memory on the CPU.
    pub(crate) machine_bytes: u64,
    pub(crate) subparticles: u64,
    /// Triangles of its meshes.
    pub(crate) triangles: u64,
    /// Whether its bonds carry moments.
    pub(crate) has_moments: bool,
}

impl DeviceOptions {
    /// Whether these options request a GPU.
    fn requests_gpu(&self) -> bool {
        self.backend == Some(BackendKind::Gpu) || self.adapter.is_some() || self.allow_software
    }
}

/// A backend of the solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackendKind {
    /// On the processor.
    Cpu,
    /// On a graphics adapter.
    Gpu,
}

/// The device that computes runs. Clones share it and its memory.
#[derive(Clone, Debug, Default)]
pub struct Device {
    adapter: Option<Arc<Adapter>>,
    /// Memory of the machine that runs on the CPU share; none where their number is fixed.
    machine: Option<Arc<MemoryBudget>>,
}

#[derive(Debug)]
struct Adapter {
    options: DeviceOptions,
    name: String,
    memory: Arc<MemoryBudget>,
    open: Mutex<Arc<Computer>>,
}

impl Adapter {
    /// The open adapter; opens it again after a failure.
    fn computer(&self) -> Result<Arc<Computer>, String> {
        let mut current = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if current.has_failed() {
            *current = Arc::new(open(&self.options)?);
        }
        Ok(current.clone())
    }
}

impl Device {
    /// The CPU.
    pub fn cpu() -> Self {
        Self::default()
    }

    /// Opens the device that the options describe.
    ///
    /// # Errors
    /// In words, when they request a GPU and none is suitable.
    pub fn choose(options: &DeviceOptions) -> Result<Self, String> {
        let requests_gpu = options.requests_gpu();
        match options.backend {
            Some(BackendKind::Cpu) if requests_gpu || options.memory_mib.is_some() => {
                Err("an adapter and its memory can only be set for the GPU backend".to_owned())
            }
            Some(BackendKind::Cpu) => Ok(Self::cpu()),
            _ => match open(options) {
                Ok(computer) => {
                    let adapter = Adapter {
                        options: options.clone(),
                        name: computer.device(),
                        memory: Arc::new(MemoryBudget::new(options.memory_mib.unwrap_or(DEFAULT_MEMORY_MIB))),
                        open: Mutex::new(Arc::new(computer)),
                    };
                    Ok(Self { adapter: Some(Arc::new(adapter)), machine: None })
                }
                Err(reason) if requests_gpu => Err(reason),
                Err(reason) => {
                    tracing::info!(%reason, "computing on the CPU");
                    Ok(Self::cpu())
                }
            },
        }
    }

    /// The stamp of the checkpoints of a scenario's run on this device.
    ///
    /// # Errors
    /// In words, when the adapter was lost and cannot be opened again.
    pub fn stamp(&self, checked: &Checked) -> Result<Stamp, String> {
        Ok(match &self.adapter {
            Some(adapter) => adapter.computer()?.stamp(checked),
            None => Computer::Cpu(CpuOptions::default()).stamp(checked),
        })
    }

    /// `cpu` or `gpu`.
    pub fn backend(&self) -> &'static str {
        if self.adapter.is_some() { "gpu" } else { "cpu" }
    }

    /// Processor and instruction set, or graphics adapter.
    pub fn name(&self) -> String {
        self.adapter.as_ref().map_or_else(roost_solver::cpu::device_name, |adapter| adapter.name.clone())
    }

    /// Memory for runs, in MiB: the configured memory of a GPU, or the memory of the machine. None where neither is known.
    pub(crate) fn memory_mib(&self) -> Option<u32> {
        let configured = self.adapter.as_ref().and_then(|adapter| adapter.options.memory_mib);
        configured.or_else(crate::memory::memory_mib)
    }

    /// Limits runs on the CPU to the memory of the machine, if that is known. An adapter has its own limit.
    pub(crate) fn share_memory(&mut self) {
        if self.adapter.is_none() {
            self.machine = self.memory_mib().map(|mib| Arc::new(MemoryBudget::new(share_of_machine(mib))));
        }
    }

    fn memory(&self) -> Option<&Arc<MemoryBudget>> {
        self.adapter.as_ref().map(|adapter| &adapter.memory).or(self.machine.as_ref())
    }

    /// Announces a run: until it has its memory, or the returned value is dropped, no other run fits.
    pub(crate) fn announce_run(&self) -> Option<PendingRun> {
        self.memory().map(|memory| memory.announce_run())
    }

    /// The number of further runs that fit into memory; waits until one fits.
    pub(crate) async fn runs_that_fit(&self) -> usize {
        match self.memory() {
            // An adapter tries one run before the size of any is known; the memory of a machine suffices for most.
            Some(memory) => {
                memory.runs_that_fit().await.unwrap_or(if self.adapter.is_some() { 1 } else { usize::MAX })
            }
            None => usize::MAX,
        }
    }

    /// Reserves the device for a run of this size: threads of the CPU, or memory of the adapter.
    ///
    /// # Errors
    /// When other runs leave too little memory, or the adapter has failed and cannot be opened again.
    pub(crate) async fn reserve(
        &self,
        threads: usize,
        size: RunSize,
    ) -> Result<ReservedDevice, ReserveError> {
        let Some(adapter) = self.adapter.clone() else {
            let share = match &self.machine {
                Some(memory) => Some(memory.take(size.machine_bytes).ok_or(ReserveError::MemoryInUse)?),
                None => None,
            };
            let computer = Arc::new(Computer::Cpu(CpuOptions { threads }));
            return Ok(ReservedDevice { computer, _share: share });
        };
        let share = adapter.memory.take(typical_bytes(size)).ok_or(ReserveError::MemoryInUse)?;
        // Opening an adapter takes a while.
        let computer = tokio::task::spawn_blocking(move || adapter.computer()).await;
        let computer =
            computer.unwrap_or_else(|error| Err(error.to_string())).map_err(ReserveError::Failed)?;
        Ok(ReservedDevice { computer, _share: Some(share) })
    }
}

/// Why a device cannot be reserved.
#[derive(Debug)]
pub(crate) enum ReserveError {
    /// Other runs use the memory.
    MemoryInUse,
    /// The adapter has failed, in words.
    Failed(String),
}

/// A device with memory for one run.
#[derive(Debug)]
pub(crate) struct ReservedDevice {
    computer: Arc<Computer>,
    /// Memory of the adapter or the machine.
    _share: Option<MemoryShare>,
}

impl ReservedDevice {
    /// Runs one scenario to its end, from a checkpoint or from zero; an error when the checkpoint is refused or the memory does not
    /// suffice.
    pub(crate) fn simulate(
        &self,
        checked: &Checked,
        checkpoint: Option<&Checkpoint>,
        observer: &mut dyn Observer,
    ) -> Result<RunResult, SimulateError> {
        self.computer.simulate_from(checked, checkpoint, observer)
    }
}

#[cfg(feature = "gpu")]
fn open(options: &DeviceOptions) -> Result<Computer, String> {
    use roost_solver::gpu::{Gpu, GpuOptions};
    let options = GpuOptions {
        device: options.adapter.clone(),
        allow_software: options.allow_software,
        only_discrete: !options.requests_gpu(),
        memory_bytes: options.memory_mib.map(|mib| u64::from(mib) << 20),
    };
    let gpu = Gpu::new(&options).map_err(|error| error.to_string())?;
    Ok(Computer::Gpu(Arc::new(gpu)))
}

#[cfg(not(feature = "gpu"))]
fn open(_options: &DeviceOptions) -> Result<Computer, String> {
    Err("this program was built without the GPU backend".to_owned())
}

#[cfg(feature = "gpu")]
fn typical_bytes(size: RunSize) -> u64 {
    roost_solver::gpu::typical_run_bytes(size.subparticles, size.triangles, size.has_moments)
}

#[cfg(not(feature = "gpu"))]
fn typical_bytes(_size: RunSize) -> u64 {
    0
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use roost_solver::gpu::source::Source;
    use roost_solver::gpu::{Gpu, GpuOptions};
    use roost_solver::mesh::Meshes;
    use roost_solver::scenario::Scenario;
    use roost_solver::{Flow, Limits, Progress, check, scenario};

    use super::*;

    /// Mesa's software adapter; none where ROOST_SKIP_GPU skips these tests.
    fn software() -> Option<Device> {
        if std::env::var_os("ROOST_SKIP_GPU").is_some() {
            eprintln!("left out: ROOST_SKIP_GPU is set");
            return None;
        }
        let options = DeviceOptions {
            adapter: Some("llvmpipe".to_owned()),
            allow_software: true,
            ..Default::default()
        };
        Some(Device::choose(&options).expect("`make needs` installs it"))
    }

    fn small() -> Checked {
        let text = r#"{"experiment": "hopper", "product": {"count": 1, "subparticle_radius_m": 0.009},
            "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
            "numerics": {"timestep_s": "auto", "duration_s": 0.05}}"#;
        let scenario = scenario::parse(text).expect("a sound scenario");
        checked(&scenario)
    }

    fn checked(scenario: &Scenario) -> Checked {
        check(scenario, &Meshes::default(), &Limits::default()).expect("one that can run")
    }

    const SIZE: RunSize = RunSize { subparticles: 1000, triangles: 0, has_moments: false, machine_bytes: 0 };

    fn reserve(device: &Device) -> ReservedDevice {
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        runtime.block_on(device.reserve(1, SIZE)).expect("an adapter")
    }

    fn result(device: &Device) -> RunResult {
        let result = reserve(device).simulate(&small(), None, &mut |_: &Progress| Flow::Continue);
        result.expect("enough memory")
    }

    #[test]
    fn concurrent_runs_share_an_adapter_and_give_equal_results() {
        let Some(device) = software() else { return };
        let alone = result(&device);
        assert_eq!((device.backend(), &alone.solver.device), ("gpu", &device.name()));
        let together: Vec<RunResult> = std::thread::scope(|scope| {
            let runs: Vec<_> = (0..3).map(|_| scope.spawn(|| result(&device))).collect();
            runs.into_iter().map(|run| run.join().expect("a result")).collect()
        });
        for result in together {
            assert_eq!((&result.responses, &result.series), (&alone.responses, &alone.series));
        }
    }

    #[test]
    fn only_a_lost_adapter_is_opened_again() {
        let Some(device) = software() else { return };
        let adapter = device.adapter.clone().expect("an adapter");
        let first = adapter.computer().expect("it is open");
        let broken = std::thread::scope(|scope| {
            let reserved = reserve(&device);
            let mut panics = |_: &Progress| panic!("an observer panics");
            scope.spawn(move || reserved.simulate(&small(), None, &mut panics).is_ok()).join()
        });
        assert!(broken.is_err());
        assert!(Arc::ptr_eq(&first, &adapter.computer().expect("it is open")), "it works");
        let options =
            GpuOptions { device: Some("llvmpipe".into()), allow_software: true, ..GpuOptions::default() };
        let lost = roost_solver::gpu::Device::open(&options).expect("an adapter");
        let gpu = Gpu::with(lost.clone(), &Source::kernels()).expect("kernels that compile");
        *adapter.open.lock().expect("no panic") = Arc::new(Computer::Gpu(Arc::new(gpu)));
        let late = reserve(&device);
        lost.wgpu().0.destroy();
        let fails = move || late.simulate(&small(), None, &mut |_: &Progress| Flow::Continue);
        assert!(std::thread::spawn(fails).join().is_err());
        assert!(result(&device).response("discharged_kg").is_some());
        assert!(!adapter.computer().expect("it is open").has_failed());
    }

    #[test]
    fn a_run_that_exceeds_the_memory_fails_alone() {
        let Some(device) = software() else { return };
        let options = device.adapter.clone().expect("an adapter").options.clone();
        let device = Device::choose(&DeviceOptions { memory_mib: Some(1), ..options }).expect("an adapter");
        let alone = result(&device);
        let mut large = serde_json::json!(small().scenario());
        large["product"]["count"] = 40.into();
        large["equipment"]["hopper_width_m"] = 1.0.into();
        let large = checked(&scenario::from_value(&large).expect("a sound scenario"));
        let beside = std::thread::scope(|scope| {
            let small = scope.spawn(|| result(&device));
            let computer = device.adapter.as_ref().expect("an adapter").computer().expect("it is open");
            let mut keep_on = |_: &Progress| Flow::Continue;
            let refused = computer.simulate(&large, &mut keep_on);
            let words = refused.map(|result| result.performance).expect_err("too little memory");
            assert!(words.to_string().starts_with("no room on the device: "), "{words}");
            assert!(!computer.has_failed());
            small.join().expect("a result")
        });
        assert_eq!((&beside.responses, &beside.series), (&alone.responses, &alone.series));
    }

    #[test]
    fn only_a_requested_adapter_is_used() {
        assert!(software().is_none_or(|device| device.backend() == "gpu"));
        let refused = |options| Device::choose(&options).expect_err("nothing of that kind");
        let options =
            DeviceOptions { adapter: Some("no such adapter".to_owned()), ..DeviceOptions::default() };
        assert!(refused(options.clone()).starts_with("no GPU: "));
        let options = DeviceOptions { backend: Some(BackendKind::Cpu), ..options };
        assert_eq!(refused(options), "an adapter and its memory can only be set for the GPU backend");
    }
}
