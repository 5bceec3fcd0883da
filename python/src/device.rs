//! The device of a run, by its name: `cpu`, `gpu`, or `gpu:` with a part of an adapter's name.

use roost_solver::{Computer, CpuOptions};

/// Opens a device.
///
/// # Errors
/// Why it cannot be used, in words.
pub(crate) fn open(name: &str, threads: usize) -> Result<Computer, String> {
    match name.split_once(':').unwrap_or((name, "")) {
        ("cpu", "") => Ok(Computer::Cpu(CpuOptions { threads })),
        ("gpu", adapter) => gpu(adapter),
        _ => Err(format!(
            "device is {name:?}; allowed: \"cpu\", \"gpu\", or \"gpu:\" with a part of an adapter's name"
        )),
    }
}

/// The adapter. Runs in several threads share it, and advance as one batch. After a failure it is opened again.
#[cfg(feature = "gpu")]
fn gpu(adapter: &str) -> Result<Computer, String> {
    use std::collections::HashMap;
    use std::sync::{Arc, LazyLock, Mutex, PoisonError};

    use roost_solver::gpu::{Gpu, GpuOptions};

    static OPEN: LazyLock<Mutex<HashMap<String, Computer>>> = LazyLock::new(Mutex::default);
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(computer) = open.get(adapter).filter(|computer| !computer.has_failed()) {
        return Ok(computer.clone());
    }
    // A software adapter is slower than the CPU: only its name requests it.
    let name = Some(adapter.to_owned()).filter(|name| !name.is_empty());
    let options = GpuOptions { allow_software: name.is_some(), device: name, ..GpuOptions::default() };
    let computer = Computer::Gpu(Arc::new(Gpu::new(&options).map_err(|error| error.to_string())?));
    open.insert(adapter.to_owned(), computer.clone());
    Ok(computer)
}

#[cfg(not(feature = "gpu"))]
fn gpu(_adapter: &str) -> Result<Computer, String> {
    Err("this package was built without the GPU backend".to_owned())
}
