//! Embeds what the server carries beside its code: the migrations, the files of the dashboard, and plotly.js
//! from the crate that contains it.
//!
//! `sqlx::migrate!` would embed the migrations too, but its macro compiles SQLite a second time.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::{env, fs};

use flate2::Compression;
use flate2::write::GzEncoder;

fn main() {
    println!("cargo:rerun-if-changed=../migrations");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=dashboard");
    let out = env::var("OUT_DIR").expect("cargo sets it");
    let root = Path::new(&env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).to_owned();
    for (list, folder, extensions) in [
        ("migrations.rs", "../migrations", &["sql"][..]),
        ("dashboard.rs", "dashboard", &["css", "html", "js", "svg"][..]),
    ] {
        let list_of_files = file_list(&root.join(folder), extensions);
        fs::write(Path::new(&out).join(list), list_of_files).expect("OUT_DIR can be written");
    }
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(first_script(&plotly::Plot::offline_js_sources()).as_bytes()).expect("memory takes it");
    let packed = packed.finish().expect("memory takes it");
    fs::write(Path::new(&out).join("plotly.min.js.gz"), packed).expect("OUT_DIR can be written");
}

/// A Rust expression: name and content of every file below a folder. The build fails on a file of another
/// extension, such as the backup of an editor: everything here is served. `README.md` is left out.
fn file_list(root: &Path, extensions: &[&str]) -> String {
    let mut folders = vec![root.to_owned()];
    let mut files: Vec<PathBuf> = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("the folder can be read") {
            let path = entry.expect("an entry").path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    files.retain(|path| !path.ends_with("README.md"));
    files.sort();
    let is_other = |path: &&PathBuf| {
        let is_hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        let extension = path.extension().and_then(|extension| extension.to_str());
        is_hidden || !extension.is_some_and(|extension| extensions.contains(&extension))
    };
    if let Some(other) = files.iter().find(is_other) {
        let extensions = extensions.join(", ");
        panic!("{}: only files of the types {extensions} belong here: remove it", other.display());
    }
    let entry = |path: &PathBuf| {
        let name = path.strip_prefix(root).expect("below the folder").to_string_lossy().replace('\\', "/");
        format!("({name:?}, include_bytes!({path:?}) as &[u8]),\n")
    };
    format!("&[\n{}]", files.iter().map(entry).collect::<String>())
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
