//! What runs are computed on: the CPU, or a graphics adapter, which all runs of a worker share as far as its memory goes and which
//! is opened anew after it has failed.

use std::sync::{Arc, Mutex, PoisonError};

use roost_solver::result::RunResult;
use roost_solver::{Checked, Computer, CpuOptions, Observer, OutOfDeviceMemory};

use crate::room::{Coming, Room, Share};

/// Memory that runs share where nobody says how much it may be: half of what an adapter for such work usually has, since wgpu does not
/// tell how much this one has.
pub const USUAL_MEMORY_MIB: u32 = 4096;

/// Jobs at once on a GPU where nobody says how many, as far as there is memory for them. More would fill a large one better; but what a
/// worker has claimed nobody else can take, and is lost together with it.
const SLOTS_OF_A_GPU: usize = 16;

/// What somebody wants runs to be computed on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceOptions {
    /// None takes a discrete GPU if there is one, else the CPU: how fast integrated ones are was not measured.
    pub backend: Option<BackendKind>,
    /// Part of the adapter's name; none takes the first.
    pub adapter: Option<String>,
    /// Whether an adapter that is software counts as a GPU.
    pub allow_software: bool,
    /// MiB of the adapter's memory that runs may take: what is larger is refused. None lets runs share [`USUAL_MEMORY_MIB`], and tries what
    /// is larger alone.
    pub memory_mib: Option<u32>,
}

/// How large a run is, as far as memory goes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Size {
    pub(crate) subparticles: u64,
    /// Of its meshes.
    pub(crate) triangles: u64,
}

impl DeviceOptions {
    /// Whether somebody asks for a GPU.
    fn is_asked_for(&self) -> bool {
        self.backend == Some(BackendKind::Gpu) || self.adapter.is_some() || self.allow_software
    }
}

/// A way to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackendKind {
    /// On the processor.
    Cpu,
    /// On a graphics adapter.
    Gpu,
}

/// What runs are computed on. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Device(Option<Arc<Adapter>>);

#[derive(Debug)]
struct Adapter {
    options: DeviceOptions,
    name: String,
    room: Arc<Room>,
    open: Mutex<Arc<Computer>>,
}

impl Adapter {
    /// The adapter, opened anew if it has failed.
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

    /// What the options ask for.
    ///
    /// # Errors
    /// In words, when that is a GPU and none will do.
    pub fn choose(options: &DeviceOptions) -> Result<Self, String> {
        let is_asked_for = options.is_asked_for();
        match options.backend {
            Some(BackendKind::Cpu) if is_asked_for || options.memory_mib.is_some() => {
                Err("an adapter is for the GPU backend".to_owned())
            }
            Some(BackendKind::Cpu) => Ok(Self::cpu()),
            _ => match open(options) {
                Ok(computer) => Ok(Self(Some(Arc::new(Adapter {
                    options: options.clone(),
                    name: computer.device(),
                    room: Arc::new(Room::new(options.memory_mib.unwrap_or(USUAL_MEMORY_MIB))),
                    open: Mutex::new(Arc::new(computer)),
                })))),
                Err(reason) if is_asked_for => Err(reason),
                Err(reason) => {
                    tracing::info!(%reason, "computing on the CPU");
                    Ok(Self::cpu())
                }
            },
        }
    }

    /// `cpu` or `gpu`.
    pub fn backend(&self) -> &'static str {
        if self.0.is_some() { "gpu" } else { "cpu" }
    }

    /// Processor and instruction set, or graphics adapter.
    pub fn name(&self) -> String {
        self.0.as_ref().map_or_else(roost_solver::cpu::device_name, |adapter| adapter.name.clone())
    }

    /// Memory that it has for runs, in MiB: that of the machine, unless somebody says how much a GPU's may be. None where neither tells.
    pub(crate) fn memory_mib(&self) -> Option<u32> {
        let told = self.0.as_ref().and_then(|adapter| adapter.options.memory_mib);
        told.or_else(crate::memory::memory_mib)
    }

    /// Jobs at once where nobody says how many. On a GPU as many as its memory holds, up to some.
    pub fn usual_slots(&self) -> usize {
        if self.0.is_some() { SLOTS_OF_A_GPU } else { 1 }
    }

    /// Says that a run will make ready: until it has, or what comes back is dropped, there is no room for more.
    pub(crate) fn expect_run(&self) -> Option<Coming> {
        self.0.as_ref().map(|adapter| adapter.room.expect_one())
    }

    /// How many more runs there is memory for; waits until there is some for one.
    pub(crate) async fn room_for_more(&self) -> usize {
        match &self.0 {
            Some(adapter) => adapter.room.for_more().await,
            None => usize::MAX,
        }
    }

    /// Makes ready to compute a run of that size: on so many threads where that is the CPU; on an adapter if it has memory for it.
    ///
    /// # Errors
    /// When other runs leave too little memory, or an adapter that had failed cannot be opened again.
    pub(crate) async fn ready(&self, threads: usize, size: Size) -> Result<Ready, NotReady> {
        let Some(adapter) = self.0.clone() else {
            return Ok(Ready { computer: Arc::new(Computer::Cpu(CpuOptions { threads })), _share: None });
        };
        let share = adapter.room.take(usual_bytes(size)).ok_or(NotReady::NoRoomNow)?;
        // Opening an adapter takes a while.
        let computer = tokio::task::spawn_blocking(move || adapter.computer()).await;
        let computer = computer.unwrap_or_else(|error| Err(error.to_string())).map_err(NotReady::Failed)?;
        Ok(Ready { computer, _share: Some(share) })
    }
}

/// Why nothing can be computed.
#[derive(Debug)]
pub(crate) enum NotReady {
    /// Other runs have the memory.
    NoRoomNow,
    /// The adapter has failed, in words.
    Failed(String),
}

/// Ready to compute.
#[derive(Debug)]
pub(crate) struct Ready {
    computer: Arc<Computer>,
    /// What it has of the adapter's memory.
    _share: Option<Share>,
}

impl Ready {
    /// Runs one scenario to its end, or says why there is no room for it.
    pub(crate) fn simulate(
        self,
        checked: &Checked,
        observer: &mut dyn Observer,
    ) -> Result<RunResult, OutOfDeviceMemory> {
        self.computer.simulate(checked, observer)
    }
}

#[cfg(feature = "gpu")]
fn open(options: &DeviceOptions) -> Result<Computer, String> {
    use roost_solver::gpu::{Gpu, GpuOptions};
    let options = GpuOptions {
        device: options.adapter.clone(),
        allow_software: options.allow_software,
        only_discrete: !options.is_asked_for(),
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
fn usual_bytes(size: Size) -> u64 {
    roost_solver::gpu::typical_run_bytes(size.subparticles, size.triangles)
}

#[cfg(not(feature = "gpu"))]
fn usual_bytes(_size: Size) -> u64 {
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

    /// Mesa's software adapter; none where these tests may be left out.
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

    const SIZE: Size = Size { subparticles: 1000, triangles: 0 };

    fn ready(device: &Device) -> Ready {
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        runtime.block_on(device.ready(1, SIZE)).expect("an adapter")
    }

    fn result(device: &Device) -> RunResult {
        let result = ready(device).simulate(&small(), &mut |_: &Progress| Flow::Continue);
        result.expect("room for it")
    }

    #[test]
    fn runs_at_a_time_share_an_adapter_and_give_what_each_gives_alone() {
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
    fn an_adapter_that_was_lost_is_opened_anew_and_no_other() {
        let Some(device) = software() else { return };
        let adapter = device.0.clone().expect("an adapter");
        let first = adapter.computer().expect("it is open");
        let broken = std::thread::scope(|scope| {
            let ready = ready(&device);
            let mut stumbles = |_: &Progress| panic!("an observer stumbles");
            scope.spawn(move || ready.simulate(&small(), &mut stumbles).is_ok()).join()
        });
        assert!(broken.is_err());
        assert!(Arc::ptr_eq(&first, &adapter.computer().expect("it is open")), "nothing is wrong with it");
        let options =
            GpuOptions { device: Some("llvmpipe".into()), allow_software: true, ..GpuOptions::default() };
        let lost = roost_solver::gpu::Device::open(&options).expect("an adapter");
        let gpu = Gpu::with(lost.clone(), &Source::kernels()).expect("kernels that compile");
        *adapter.open.lock().expect("nobody panicked") = Arc::new(Computer::Gpu(Arc::new(gpu)));
        let late = ready(&device);
        lost.wgpu().0.destroy();
        let fails = move || late.simulate(&small(), &mut |_: &Progress| Flow::Continue);
        assert!(std::thread::spawn(fails).join().is_err());
        assert!(result(&device).response("discharged_kg").is_some());
        assert!(!adapter.computer().expect("it is open").has_failed());
    }

    #[test]
    fn a_run_too_large_says_so_and_the_others_never_hear_of_it() {
        let Some(device) = software() else { return };
        let options = device.0.clone().expect("an adapter").options.clone();
        let device = Device::choose(&DeviceOptions { memory_mib: Some(1), ..options }).expect("an adapter");
        let alone = result(&device);
        let mut large = serde_json::json!(small().scenario());
        large["product"]["count"] = 40.into();
        large["equipment"]["hopper_width_m"] = 1.0.into();
        let large = checked(&scenario::from_value(&large).expect("a sound scenario"));
        let beside = std::thread::scope(|scope| {
            let small = scope.spawn(|| result(&device));
            let computer = device.0.as_ref().expect("an adapter").computer().expect("it is open");
            let mut keep_on = |_: &Progress| Flow::Continue;
            let refused = computer.simulate(&large, &mut keep_on);
            let words = refused.map(|result| result.performance).expect_err("there is no room");
            assert!(words.to_string().starts_with("no room on the device: "), "{words}");
            assert!(!computer.has_failed());
            small.join().expect("a result")
        });
        assert_eq!((&beside.responses, &beside.series), (&alone.responses, &alone.series));
    }

    #[test]
    fn what_was_not_asked_for_is_not_taken() {
        assert!(software().is_none_or(|device| device.backend() == "gpu"));
        let refused = |options| Device::choose(&options).expect_err("nothing of that kind");
        let options =
            DeviceOptions { adapter: Some("no such adapter".to_owned()), ..DeviceOptions::default() };
        assert!(refused(options.clone()).starts_with("no GPU: "));
        let options = DeviceOptions { backend: Some(BackendKind::Cpu), ..options };
        assert_eq!(refused(options), "an adapter is for the GPU backend");
    }
}
