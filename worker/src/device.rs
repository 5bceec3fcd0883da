//! What runs are computed on: the CPU, or a graphics adapter, which all runs of a worker share and which is opened anew
//! after it has failed.

use std::sync::{Arc, Mutex, PoisonError};

use roost_solver::mesh::Meshes;
use roost_solver::result::RunResult;
use roost_solver::scenario::Scenario;
use roost_solver::{Computer, CpuOptions, Observer};

/// What somebody wants runs to be computed on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceOptions {
    /// None takes a discrete GPU if there is one, else the CPU: how fast integrated ones are was not measured.
    pub backend: Option<BackendKind>,
    /// Part of the adapter's name; none takes the first.
    pub adapter: Option<String>,
    /// Whether an adapter that is software counts as a GPU.
    pub allow_software: bool,
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
    /// None when it has failed, until it is needed again.
    open: Mutex<Option<Arc<Computer>>>,
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
            Some(BackendKind::Cpu) if is_asked_for => Err("an adapter is for the GPU backend".to_owned()),
            Some(BackendKind::Cpu) => Ok(Self::cpu()),
            _ => match open(options) {
                Ok(computer) => Ok(Self(Some(Arc::new(Adapter {
                    options: options.clone(),
                    name: computer.device(),
                    open: Mutex::new(Some(Arc::new(computer))),
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

    /// Makes ready to compute, on so many threads where that is the CPU.
    ///
    /// # Errors
    /// In words, when an adapter that had failed cannot be opened again.
    pub(crate) fn ready(&self, threads: usize) -> Result<Ready, String> {
        let Some(adapter) = &self.0 else {
            return Ok(Ready { computer: Arc::new(Computer::Cpu(CpuOptions { threads })), adapter: None });
        };
        let mut current = adapter.open.lock().unwrap_or_else(PoisonError::into_inner);
        if current.is_none() {
            *current = Some(Arc::new(open(&adapter.options)?));
        }
        let computer = current.clone().expect("it was just opened");
        Ok(Ready { computer, adapter: Some(adapter.clone()) })
    }
}

/// Ready to compute.
#[derive(Debug)]
pub(crate) struct Ready {
    computer: Arc<Computer>,
    adapter: Option<Arc<Adapter>>,
}

impl Ready {
    /// Runs one scenario to its end. A panic gives the adapter up: the next run opens it anew.
    pub(crate) fn simulate(
        self,
        scenario: &Scenario,
        meshes: &Meshes,
        observer: &mut dyn Observer,
    ) -> RunResult {
        self.computer.simulate(scenario, meshes, observer)
    }
}

impl Drop for Ready {
    fn drop(&mut self) {
        if let (true, Some(adapter)) = (std::thread::panicking(), &self.adapter) {
            let mut current = adapter.open.lock().unwrap_or_else(PoisonError::into_inner);
            // Another run may have opened it anew meanwhile.
            if current.as_ref().is_some_and(|current| Arc::ptr_eq(current, &self.computer)) {
                *current = None;
            }
        }
    }
}

#[cfg(feature = "gpu")]
fn open(options: &DeviceOptions) -> Result<Computer, String> {
    use roost_solver::gpu::{Gpu, GpuOptions};
    let options = GpuOptions {
        device: options.adapter.clone(),
        allow_software: options.allow_software,
        only_discrete: !options.is_asked_for(),
    };
    let gpu = Gpu::new(&options).map_err(|error| error.to_string())?;
    Ok(Computer::Gpu(Arc::new(gpu)))
}

#[cfg(not(feature = "gpu"))]
fn open(_options: &DeviceOptions) -> Result<Computer, String> {
    Err("this program was built without the GPU backend".to_owned())
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use roost_solver::{Flow, Limits, Progress, check, scenario};

    use super::*;

    /// Mesa's software adapter; none where these tests may be left out.
    fn software() -> Option<Device> {
        if std::env::var_os("ROOST_SKIP_GPU").is_some() {
            eprintln!("left out: ROOST_SKIP_GPU is set");
            return None;
        }
        let options =
            DeviceOptions { adapter: Some("llvmpipe".to_owned()), allow_software: true, backend: None };
        Some(Device::choose(&options).expect("`make needs` installs it"))
    }

    fn small() -> Scenario {
        let text = r#"{"experiment": "hopper", "product": {"count": 1, "subparticle_radius_m": 0.009},
            "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
            "numerics": {"timestep_s": "auto", "duration_s": 0.05}}"#;
        let scenario = scenario::parse(text).expect("a sound scenario");
        check(&scenario, &Meshes::default(), &Limits::default()).expect("one that can run");
        scenario
    }

    fn result(device: &Device) -> RunResult {
        let ready = device.ready(1).expect("an adapter");
        ready.simulate(&small(), &Meshes::default(), &mut |_: &Progress| Flow::Continue)
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
    fn an_adapter_that_fails_is_opened_anew() {
        let Some(device) = software() else { return };
        let adapter = device.0.clone().expect("an adapter");
        let is_open = || adapter.open.lock().unwrap_or_else(PoisonError::into_inner).is_some();
        let ready = device.ready(1).expect("an adapter");
        let broken = std::thread::spawn(move || {
            let mut lost = |_: &Progress| panic!("the device was lost");
            ready.simulate(&small(), &Meshes::default(), &mut lost)
        });
        assert!(broken.join().is_err() && !is_open());
        assert!(result(&device).response("discharged_kg").is_some() && is_open());
    }

    #[test]
    fn a_run_that_fails_late_leaves_an_adapter_alone_that_was_opened_since() {
        let Some(device) = software() else { return };
        let adapter = device.0.clone().expect("an adapter");
        let set = |computer| *adapter.open.lock().unwrap_or_else(PoisonError::into_inner) = computer;
        let late = device.ready(1).expect("an adapter");
        set(None);
        drop(device.ready(1).expect("opened anew"));
        let failed = std::thread::spawn(move || {
            let _late = late;
            panic!("the first adapter was lost")
        });
        assert!(failed.join().is_err());
        assert!(adapter.open.lock().unwrap_or_else(PoisonError::into_inner).is_some());
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
