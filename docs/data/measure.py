"""Simulations behind the acceptance figures of docs/validation.md that `roost reproduce` does not make.

    python3 docs/data/measure.py STUDY --roost target/debug/roost --output DIR

runs a study one simulation at a time, keeps each result in DIR, and prints means with 95 % intervals (Student) as a
Markdown table. A second call runs only what is missing. `--csv FILE` appends the value of every seed to a file.
"""

import argparse
import csv
import hashlib
import json
import math
import pathlib
import statistics
import subprocess

# Quantiles of Student's t, 97.5 %, for 1 to 15 degrees of freedom.
T = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131]


def merged(base, over):
    """`base` with the fields of `over` in it."""
    if not isinstance(base, dict) or not isinstance(over, dict):
        return over
    return {**base, **{name: merged(base.get(name), value) for name, value in over.items()}}


def lattice():
    """Modulus of a pressed lattice over R, bonds alone and with contact between bonded neighbours."""
    base = {
        "experiment": "compress",
        "compress": {"lattice": [4, 4, 4], "strain_rate_1_s": 0.02, "plates": "frictionless"},
        "numerics": {"timestep_s": "auto"},
    }
    for contact in (False, True):
        for radius in (3, 4, 5, 6, 8):
            over = {"product": {"subparticle_radius_m": radius / 1e3}, "bonds": {"contact_between_bonded": contact}}
            label = f"{radius} mm, {'with contact' if contact else 'bonds alone'}"
            yield label, merged(base, over), 1


def bed(radius_mm, duration_s):
    """The default hopper with 191 fillets."""
    return {
        "experiment": "hopper",
        "product": {"count": 191, "subparticle_radius_m": radius_mm / 1e3},
        "equipment": {"gate_opening_m": 0.06},
        "numerics": {"timestep_s": "auto", "duration_s": duration_s},
    }


def fill():
    """Interpenetration and bulk density of the bed at rest, over R and the ratio of radii between fillets."""
    for radius, seeds in ((8, 5), (6, 5), (5, 5), (4, 3)):
        for ratio in (1.0, 1.225, 1.5):
            over = {"contact": {"fillet_fillet_radius_ratio": ratio}}
            yield f"{radius} mm, ρ = {ratio}", merged(bed(radius, 0.02), over), seeds


def impact():
    """Impacts at 4 m/s with the step `auto` and with a step of 15 µs, the same seeds."""
    orientations = {"tail": {"pitch_deg": 90}, "side": {"roll_deg": 90}, "flat": {}}
    for radius, seeds in ((7, 8), (6, 8), (5, 5), (4, 6)):
        for name, angles in orientations.items():
            for step in ("auto", 15e-6):
                drop = {"speed_m_s": 4, "scatter_deg": 3, **angles}
                scenario = {
                    "experiment": "drop",
                    "product": {"count": 12, "subparticle_radius_m": radius / 1e3},
                    "drop": drop,
                    "numerics": {"timestep_s": step},
                }
                yield f"{radius} mm, {name}, {step if step == 'auto' else '15 µs'}", scenario, seeds


def belt():
    """Discharge over the friction of the belt, with and without moments in bonds."""
    for friction in (0.5, 0.3, 0.2):
        for factor in (0, 1):
            over = {
                "contact": {"fillet_belt": {"static_friction": friction}},
                "bonds": {"moment_stiffness_factor": factor},
                "numerics": {"stop": {"when_jammed_s": 2.5}},
            }
            yield f"belt friction {friction}, f = {factor}", merged(bed(6, 4.2), over), 5


# For each study its cases, the responses that it reports, and whether each second case is compared with the one before it.
STUDIES = {
    "lattice": (lattice, ["modulus_lattice_pa"], False),
    "fill": (fill, ["interpenetrated_fraction", "bulk_density_kg_m3"], False),
    "impact": (impact, ["settle_time_s", "bonds_intact_fraction"], True),
    "belt": (belt, ["mean_rate_kg_s", "discharged_kg_at_4s", "regime"], True),
}


def simulate(roost, folder, scenario):
    """The result of a scenario, from an earlier call if there is one."""
    name = f"{hash_of(scenario):016x}"
    result = folder / name / "result.json"
    # A simulation that was stopped leaves a result too.
    if not result.exists() or json.loads(result.read_text())["end_reason"] == "cancelled":
        (folder / name).mkdir(parents=True, exist_ok=True)
        document = folder / name / "scenario.json"
        document.write_text(json.dumps(scenario))
        command = [roost, "run", "--backend", "cpu", "--threads", "1", "-o", folder / name, document]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return json.loads(result.read_text())


def hash_of(scenario):
    """A number for a scenario, the same in every process."""
    text = json.dumps(scenario, sort_keys=True)
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "big")


def cell(values):
    """Mean with its 95 % interval and n, or the words with their numbers."""
    values = [value for value in values if value is not None]
    if not values:
        return "–"
    if isinstance(values[0], str):
        return ", ".join(f"{word} ({values.count(word)})" for word in sorted(set(values)))
    mean, n = statistics.fmean(values), len(values)
    if n == 1:
        return f"{mean:.4g} (n = 1)"
    half = T[n - 2] * statistics.stdev(values) / math.sqrt(n)
    return f"{mean:.4g} ± {half:.2g} (n = {n})"


def seed_by_seed(first, second):
    """Differences of the numbers of two cases with the same seeds."""
    pairs = zip(first, second)
    return [a - b for a, b in pairs if isinstance(a, (int, float)) and isinstance(b, (int, float))]


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("study", choices=STUDIES)
    arguments.add_argument("--roost", default="target/debug/roost")
    arguments.add_argument("--output", type=pathlib.Path, required=True)
    arguments.add_argument("--csv", type=pathlib.Path)
    given = arguments.parse_args()
    cases, responses, compares = STUDIES[given.study]
    folder = given.output / given.study
    print(f"| {given.study} | " + " | ".join(responses) + " |\n" + "|---" * (len(responses) + 1) + "|", flush=True)
    rows, earlier = [], {}
    for number, (label, scenario, seeds) in enumerate(cases()):
        found = {name: [] for name in responses}
        for seed in range(1, seeds + 1):
            result = simulate(given.roost, folder, {**scenario, "seed": seed})
            for name in responses:
                value = result["responses"].get(name)
                found[name].append(value)
                rows.append([given.study, label, seed, name, value, result["solver"]["revision"]])
        print(f"| {label} | " + " | ".join(cell(found[name]) for name in responses) + " |", flush=True)
        if compares and number % 2 == 1:
            differences = (cell(seed_by_seed(earlier[name], found[name])) for name in responses)
            print("| first less second, seed by seed | " + " | ".join(differences) + " |", flush=True)
        earlier = found
    if given.csv:
        is_new = not given.csv.exists()
        with given.csv.open("a", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([["study", "case", "seed", "response", "value", "solver_revision"]] * is_new + rows)


main()
