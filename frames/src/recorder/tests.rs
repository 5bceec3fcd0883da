//! The recorder: sizes, limits and removal of old files.

use std::fs::File;

use super::*;
use crate::testing::{bonds, hopper_with_fillets, snapshot_at};

const ALL: Options = Options { interval_s: 0.06, vtk: true, web: true, limit_bytes: u64::MAX };

/// Records frames of fillets at rest; returns the report and the actual size of the files.
fn record(folder: &Path, options: Options, frames: u32) -> (Report, u64) {
    let (scenario, scene, state) = hopper_with_fillets(2);
    let bonds = bonds(&scene);
    let mut recorder = FrameRecorder::create(folder, &scenario, 1e-4, options).expect("a folder");
    for k in 0..frames {
        let simulated_s = 0.06 * f64::from(k);
        if recorder.wants_snapshot(simulated_s) {
            recorder.snapshot(&snapshot_at(&scene, &state, &bonds, simulated_s, None));
        }
    }
    (recorder.finish(), size(folder))
}

/// Bytes below a folder, without the collection and the names of surfaces.
fn size(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let counted = entries.filter(|path| !path.ends_with(LEGEND) && !path.ends_with(COLLECTION));
    counted.map(|path| if path.is_dir() { size(&path) } else { path.metadata().expect("a file").len() }).sum()
}

#[test]
fn reported_size_is_the_size_of_the_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let (report, size) = record(folder.path(), ALL, 4);
    assert_eq!((report.frames, report.stopped), (4, None));
    assert_eq!(report.files, [COLLECTION, STREAM].map(|name| folder.path().join(name)));
    assert_eq!(report.bytes, size);
    let surfaces = folder.path().join("vtk/surfaces_000001.vtp");
    assert!(!surfaces.exists(), "equipment that stands still is written once");
    let collection = fs::read_to_string(folder.path().join(COLLECTION)).expect("a collection");
    assert_eq!(collection.matches("vtk/surfaces_000000.vtp").count(), 4);
}

#[test]
fn recording_stops_at_the_limit_with_valid_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let (all, _) = record(folder.path(), ALL, 6);
    let limit = all.bytes - 1;
    let (report, size) = record(folder.path(), Options { limit_bytes: limit, ..ALL }, 6);
    assert_eq!(report.frames, 5);
    assert!(report.bytes == size && size <= limit, "{size} of {limit}");
    let why = report.stopped.expect("it stopped");
    assert!(why.contains("0.300 s") && why.contains(&limit.to_string()), "{why}");
    let stream = File::open(folder.path().join(STREAM)).expect("a stream");
    let stream = crate::web::Reader::open(stream).expect("a stream");
    assert!(stream.is_complete() && stream.index().len() == 5);
    assert!(!folder.path().join("vtk/particles_000005.vtp").exists(), "of an earlier run");
}

#[test]
fn a_removed_folder_stops_recording_but_not_the_run() {
    let (scenario, scene, state) = hopper_with_fillets(1);
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = FrameRecorder::create(folder.path(), &scenario, 1e-4, ALL).expect("a folder");
    recorder.snapshot(&snapshot_at(&scene, &state, &[], 0.0, None));
    fs::remove_dir_all(folder.path().join(FOLDER)).expect("removed");
    recorder.snapshot(&snapshot_at(&scene, &state, &[], 0.06, None));
    assert!(recorder.stopped().is_some_and(|why| why.contains("ParaView")), "{:?}", recorder.stopped());
    assert!(!recorder.wants_snapshot(0.12));
    assert_eq!(recorder.finish().frames, 1);
}

#[test]
fn only_frames_of_an_earlier_run_are_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path(FOLDER)).expect("a folder");
    let old = ["vtk/particles_000123.vtp", "vtk/surfaces_1000000.vtp", STREAM, COLLECTION, LEGEND];
    let mine = ["notes.txt", "vtk/particles_mine.vtp", "vtk/particles_1.vtp", "vtk/particles_000123.vtu"];
    old.iter().chain(&mine).for_each(|name| fs::write(path(name), "x").expect("written"));
    clear(folder.path()).expect("cleared");
    assert!(old.iter().all(|name| !path(name).exists()));
    assert!(mine.iter().all(|name| path(name).exists()));
}
