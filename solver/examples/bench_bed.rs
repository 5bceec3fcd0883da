//! Times the plain and the fast path on the bulk hopper, in turn, in one process. On a machine that others load
//! too, look at the ratio, and at the time of processors rather than that of the wall. `bench_bed [threads] [radius_mm] [fill_s] [belt_s] [paths]`, paths being any of
//! `plain`, `fast` and the names of instruction sets, with commas between.

use std::time::Instant;

use roost_solver::cpu::fast::Instructions;
use roost_solver::cpu::{Cpu, CpuRun};
use roost_solver::engine::Backend;
use roost_solver::experiments::prepare;
use roost_solver::mesh::Meshes;
use roost_solver::scenario;
use serde_json::json;

/// Steps between two turns.
const TURN: u64 = 50;

struct Racer {
    name: String,
    cpu: Cpu,
    run: CpuRun,
    seconds: f64,
    busy_s: f64,
    particle_steps: u64,
}

/// Time that processors have worked for this process, in seconds, where the system tells; else 0.
fn processor_s() -> f64 {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else { return 0.0 };
    let of = |task: std::fs::DirEntry| std::fs::read_to_string(task.path().join("schedstat")).ok();
    let first = |text: String| text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok());
    tasks.flatten().filter_map(of).filter_map(first).sum::<f64>() * 1e-9
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, or: f64| arguments.get(k).map_or(or, |text| text.parse().expect("a number"));
    let (threads, radius_mm, fill_s, belt_s) =
        (number(0, 1.0), number(1, 6.0), number(2, 1.2), number(3, 0.5));
    let paths = arguments.get(4).map_or("plain,fast", String::as_str);
    let document = json!({
        "experiment": "hopper",
        "product": {"subparticle_radius_m": radius_mm * 1e-3},
        "numerics": {"timestep_s": "auto"},
    });
    let scene =
        prepare(&scenario::from_value(&document).expect("a sound scenario"), &Meshes::default()).scene;
    let dt = scene.timestep_s;
    let mut racers: Vec<Racer> = paths
        .split(',')
        .map(|name| {
            let named = Instructions::available().into_iter().find(|set| set.name() == name);
            let cpu = match name {
                "plain" => Cpu::plain(threads as usize),
                "fast" => Cpu::new(threads as usize),
                _ => Cpu::fast(threads as usize, named.expect("an instruction set that this machine has")),
            };
            let run = cpu.prepare(&scene);
            Racer { name: name.to_owned(), cpu, run, seconds: 0.0, busy_s: 0.0, particle_steps: 0 }
        })
        .collect();
    let count: usize = scene.bodies.iter().map(|body| scene.kinds[body.kind].meta.points.len()).sum();
    println!("{count} sub-particles, step {:.3e} s, threads {threads}", dt);
    for (phase, seconds) in [("fill", fill_s), ("belt", belt_s)] {
        let parts = 4;
        for part in 1..=parts {
            let steps = (seconds / dt / f64::from(parts)) as u64;
            for racer in &mut racers {
                (racer.seconds, racer.busy_s, racer.particle_steps) = (0.0, 0.0, 0);
            }
            for _ in 0..steps.div_ceil(TURN) {
                for racer in &mut racers {
                    let (clock, busy) = (Instant::now(), processor_s());
                    let done = racer.cpu.advance(&mut [(&mut racer.run, TURN)]).swap_remove(0);
                    racer.seconds += clock.elapsed().as_secs_f64();
                    racer.busy_s += processor_s() - busy;
                    racer.particle_steps += done.particle_steps;
                    assert_eq!(done.fault, None);
                }
            }
            print!("{phase} {part}/{parts}:");
            let share = |seconds: f64, racer: &Racer| seconds * 1e9 / racer.particle_steps.max(1) as f64;
            let cost = |racer: &Racer| share(racer.busy_s, racer);
            for racer in &mut racers {
                let energy = racer.cpu.state(&mut racer.run).kinetic_energy();
                let (busy, wall) = (cost(racer), share(racer.seconds, racer));
                print!(
                    "  {} {busy:.1} ns of processor, {wall:.1} ns of wall (kinetic {energy:.3} J)",
                    racer.name
                );
            }
            println!("  ratio {:.2}", cost(&racers[0]) / cost(&racers[racers.len() - 1]));
        }
        if phase == "fill" {
            for racer in &mut racers {
                racer.cpu.start(&mut racer.run);
            }
        }
    }
}
