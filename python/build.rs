//! Linker arguments of a Python module, which macOS needs. `.cargo/config.toml` makes the build independent of the interpreter.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
