//! Rebuilds the server when a migration is added, which `sqlx::migrate!` alone does not see; takes plotly.js out of the crate that
//! carries it, and packs it for the dashboard.

use std::io::Write;
use std::path::Path;
use std::{env, fs};

use flate2::Compression;
use flate2::write::GzEncoder;

fn main() {
    println!("cargo:rerun-if-changed=../migrations");
    println!("cargo:rerun-if-changed=build.rs");
    let out = env::var("OUT_DIR").expect("cargo sets it");
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(first_script(&plotly::Plot::offline_js_sources()).as_bytes()).expect("memory takes it");
    let packed = packed.finish().expect("memory takes it");
    fs::write(Path::new(&out).join("plotly.min.js.gz"), packed).expect("OUT_DIR can be written");
}

/// The first script among the crate's: plotly.js, before MathJax.
fn first_script(scripts: &str) -> &str {
    let (_, script) = scripts.split_once('>').expect("a script begins with its tag");
    let (script, _) = script.split_once("</script>\n").expect("a script ends with its tag");
    assert!(
        script.trim_start().starts_with("/**\n* plotly.js v"),
        "the crate plotly carries something else first"
    );
    script
}
