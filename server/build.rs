//! Embeds what the server carries beside its code: the migrations, and plotly.js for the dashboard, packed.
//!
//! `sqlx::migrate!` would embed the migrations too, but it compiles SQLite a second time, for the macro: 55 s of the first build.

use std::io::Write;
use std::path::Path;
use std::{env, fs};

use flate2::Compression;
use flate2::write::GzEncoder;

fn main() {
    println!("cargo:rerun-if-changed=../migrations");
    println!("cargo:rerun-if-changed=build.rs");
    let out = env::var("OUT_DIR").expect("cargo sets it");
    fs::write(Path::new(&out).join("migrations.rs"), migrations()).expect("OUT_DIR can be written");
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(first_script(&plotly::Plot::offline_js_sources()).as_bytes()).expect("memory takes it");
    let packed = packed.finish().expect("memory takes it");
    fs::write(Path::new(&out).join("plotly.min.js.gz"), packed).expect("OUT_DIR can be written");
}

/// A Rust array of (file name, SQL text) of all migrations, in order.
fn migrations() -> String {
    let folder = fs::canonicalize("../migrations").expect("the folder of migrations exists");
    let entries = fs::read_dir(folder).expect("the folder of migrations can be read");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry can be read").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "sql"));
    paths.sort();
    let row = |path: &Path| {
        let name = path.file_stem().expect("a migration has a name");
        format!("({name:?}, include_str!({path:?})),\n")
    };
    format!("&[\n{}]", paths.iter().map(|path| row(path)).collect::<String>())
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
