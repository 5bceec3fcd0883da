//! The tests of the Python package: pytest, the types by mypy and pyright, and the stub of the native module by stubtest.
//!
//! They use the package of the sources with the native module of this build, and the tools of `make python-tools`.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;
use std::{env, fs};

fn sources() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of the build, `target/debug`.
fn build() -> PathBuf {
    let test = env::current_exe().expect("a path");
    test.parent().and_then(Path::parent).expect("target/debug/deps").to_owned()
}

/// A folder with the package `roost`: its sources, and the native module.
static PACKAGE: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = build().join("python");
    let package = folder.join("roost");
    fs::create_dir_all(&folder).expect("a folder");
    let staged =
        Command::new(tool("python/bin/python")).arg(sources().join("stage.py")).arg(&folder).status();
    assert!(staged.expect("stage.py starts").success(), "stage.py fails");
    let name = format!("{}_native{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX);
    let native = if cfg!(windows) { "_native.pyd" } else { "_native.abi3.so" };
    fs::copy(build().join("deps").join(name), package.join(native)).expect("the native module");
    folder
});

/// A program of the tools.
fn tool(path: &str) -> PathBuf {
    let target = build().parent().expect("target").to_owned();
    let path = target.join("tools").join(path);
    assert!(path.exists(), "{} is missing: `make python-tools` installs it", path.display());
    path
}

fn run(command: &mut Command) {
    let output = command
        .current_dir(sources())
        .env("PYTHONPATH", &*PACKAGE)
        // Compiled modules, without which each interpreter compiles pandas for seconds. Not among the sources.
        .env("PYTHONPYCACHEPREFIX", build().join("python-cache"))
        .env_remove("PYTHONDONTWRITEBYTECODE")
        .output()
        .expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{}\n{stdout}\n{stderr}", output.status);
    println!("{stdout}");
}

/// Tests that start many interpreters: they run beside the others.
const SLOW: [&str; 2] = ["tests/test_examples.py", "tests/test_notebooks.py"];

#[test]
fn examples_and_notebooks_run() {
    pytest(&SLOW);
}

#[test]
fn python_tests_pass() {
    pytest(&SLOW.map(|file| format!("--ignore={file}")));
}

fn pytest(arguments: &[impl AsRef<OsStr>]) {
    let roost = build().join("roost").with_extension(env::consts::EXE_EXTENSION);
    assert!(roost.exists(), "{} is missing: `cargo build` makes it", roost.display());
    let folder = tempfile::tempdir().expect("a folder");
    run(Command::new(tool("python/bin/pytest"))
        .args(["--quiet", "-p", "no:cacheprovider", "--durations=5", "--basetemp"])
        .arg(folder.path().join("pytest"))
        .args(arguments)
        .env("ROOST_COMMAND", roost)
        // No test may depend on what another one has filled, or on a server of the user.
        .env("ROOST_FILLS", "")
        .env_remove("ROOST_SERVER")
        .env_remove("ROOST_TOKEN"));
}

#[test]
fn types_pass_mypy() {
    let cache = build().join("python/mypy");
    run(Command::new(tool("python/bin/mypy"))
        .args(["roost", "tests", "benches", "examples", "--cache-dir"])
        .arg(cache));
}

/// The stub of the sources is compared with the module of this build.
#[test]
fn the_stub_is_that_of_the_native_module() {
    let configuration = sources().join("pyproject.toml");
    run(Command::new(tool("python/bin/stubtest"))
        .args(["roost._native", "--mypy-config-file"])
        .arg(configuration));
}

#[test]
fn types_pass_pyright() {
    run(Command::new("node")
        .arg(tool("pyright/node_modules/pyright/index.js"))
        .arg("--pythonpath")
        .arg(tool("python/bin/python")));
}
