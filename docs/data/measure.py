"""Simulations behind the acceptance figures of docs/validation.md that `roost reproduce` does not make.

    python3 docs/data/measure.py STUDY --roost target/debug/roost --output DIR

runs a study one simulation at a time, keeps each result in DIR, and prints means with 95 % intervals (Student) and ranges as a
Markdown table. A second call runs only what is missing. `--csv FILE` adds the values to a file, after each simulation. Values of
the same revision that the file has already are not simulated again. There, each value of a simulation has its own row. Its
replicate is a seed, or the name of the fillet's size, heading or place.
"""

import argparse
import csv
import hashlib
import json
import math
import pathlib
import statistics
import subprocess
import sys
from typing import NamedTuple

SILO = pathlib.Path(__file__).parents[2] / "solver/tests/silo/silo.py"
# Quantiles of Student's t, 97.5 %, for 1 to 30 degrees of freedom.
T = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110]
T += [2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042]


class Case(NamedTuple):
    """Simulations of which the table has one mean."""

    label: str
    # Scenarios by replicate. Cases that are compared have the same replicates.
    scenarios: dict
    # Labels of earlier cases with which the table compares this one.
    against: tuple = ()


def merged(base, over):
    """`base` with the fields of `over` in it."""
    if not isinstance(base, dict) or not isinstance(over, dict):
        return over
    return {**base, **{name: merged(base.get(name), value) for name, value in over.items()}}


def seeds(scenario, count):
    """A scenario with the seeds from 1 on."""
    return {seed: {**scenario, "seed": seed} for seed in range(1, count + 1)}


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
            yield Case(label, seeds(merged(base, over), 1))


# The default fill of the present format of scenarios.
BY_VOLUME = {"product": {"fill": "volume"}}


def bed(radius_mm, duration_s):
    """The default hopper with 191 fillets."""
    return {
        "experiment": "hopper",
        "product": {"count": 191, "subparticle_radius_m": radius_mm / 1e3},
        "equipment": {"gate_opening_m": 0.06},
        "numerics": {"timestep_s": "auto", "duration_s": duration_s},
    }


def radius():
    """Discharge of the whole hopper over R, also with a fill by volume, and with a larger radius between fillets."""
    for words, over, counts in (
        ("", {}, (18, 24, 18, 18)),
        (", by volume", BY_VOLUME, (12, 12, 12, 12)),
        (", ρ = 1.225", {"contact": {"fillet_fillet_radius_ratio": 1.225}}, (6, 6, 6, 6)),
        (", ρ = 1.225, by volume", merged({"contact": {"fillet_fillet_radius_ratio": 1.225}}, BY_VOLUME), (6, 6, 6, 6)),
    ):
        for radius, count in zip((4, 5, 6, 7), counts):
            scenario = merged(bed(radius, 4.2), over)
            yield Case(f"{radius} mm{words}", seeds(scenario, count), (f"4 mm{words}",) if radius > 4 else ())


def gates():
    """Discharge over the opening and the ratio of radii between fillets."""
    for gate in (6, 4.5):
        for ratio in (1, 1.225, 1.5):
            over = {"equipment": {"gate_opening_m": gate / 100}, "contact": {"fillet_fillet_radius_ratio": ratio}}
            against = [f"{gate} cm, ρ = 1"] * (ratio > 1) + [f"6 cm, ρ = {ratio}"] * (gate < 6)
            yield Case(f"{gate} cm, ρ = {ratio}", seeds(merged(bed(6, 4.2), over), 5), tuple(against))


def fill():
    """Interpenetration and bulk density of the bed at rest, over R and the ratio of radii between fillets."""
    for radius, count in ((8, 5), (7, 5), (6, 5), (5, 5), (4, 5)):
        for ratio in (1.0, 1.225, 1.5):
            over = {"contact": {"fillet_fillet_radius_ratio": ratio}}
            yield Case(f"{radius} mm, ρ = {ratio}", seeds(merged(bed(radius, 0.02), over), count))
    stiff = {
        "contact": {"fillet_fillet_radius_ratio": 1.225},
        "bonds": {"normal_stiffness_n_m3": 5e6, "shear_stiffness_n_m3": 3e6},
    }
    yield Case("6 mm, ρ = 1.225, bonds five times as stiff", seeds(merged(bed(6, 0.02), stiff), 5))
    for radius in (8, 7, 6, 5, 4):
        for ratio in (1.0, 1.225, 1.5):
            over = merged({"contact": {"fillet_fillet_radius_ratio": ratio}}, BY_VOLUME)
            yield Case(f"{radius} mm, ρ = {ratio}, by volume", seeds(merged(bed(radius, 0.02), over), 5))


def dropped():
    """Interpenetration after a fillet has fallen on another one at 3 m/s, over five places along the lying one."""
    for ratio in (1, 1.1, 1.225, 1.5):
        for radius in (4, 5, 6, 8):
            for roll in (0, 40, 90):
                scenarios = {f"{10 + offset} mm": dropped_at(10 + offset, radius, ratio, roll) for offset in (0, -6, -3, 3, 6)}
                yield Case(f"{radius} mm, ρ = {ratio}, rolled by {roll}°", scenarios)
                if ratio in (1.225, 1.5):
                    by_volume = {place: merged(scenario, BY_VOLUME) for place, scenario in scenarios.items()}
                    yield Case(f"{radius} mm, ρ = {ratio}, rolled by {roll}°, by volume", by_volume)


def dropped_at(x_mm, radius_mm, ratio, roll_deg):
    """A fillet that falls at 3 m/s on one that lies on a floor."""
    turned = {"orientation_deg": [roll_deg, 0, 0], "velocity_m_s": [0, 0, -3]}
    falling = {"shape": 2, "position_m": [x_mm / 1e3, 0.01, 0.12], **turned}
    floor = {"name": "floor", "plate_m": [[-0.4, -0.4, 0], [0.8, 0, 0], [0, 0.8, 0]]}
    return {
        "experiment": "scene",
        "product": {"subparticle_radius_m": radius_mm / 1e3},
        "contact": {"fillet_fillet_radius_ratio": ratio},
        "scene": {"bodies": [{"position_m": [0, 0, 0.025]}, falling], "surfaces": [floor]},
        "numerics": {"timestep_s": "auto", "duration_s": 0.8},
        "seed": 1,
    }


def impact():
    """Impacts at 4 m/s with the step `auto` and with a step of 15 µs, the same seeds."""
    orientations = {"tail": {"pitch_deg": 90}, "side": {"roll_deg": 90}, "flat": {}}
    for radius, count in ((7, 8), (6, 8), (5, 5), (4, 6)):
        for name, angles in orientations.items():
            # More impacts where the interval of the difference was wider than the target.
            many = 24 if (radius, name) == (7, "tail") else count
            for step in (15e-6, "auto"):
                scenario = {
                    "experiment": "drop",
                    "product": {"count": 12, "subparticle_radius_m": radius / 1e3},
                    "drop": {"speed_m_s": 4, "scatter_deg": 3, **angles},
                    "numerics": {"timestep_s": step},
                }
                for words, over in (("", {}), (", by volume", BY_VOLUME)):
                    label, short = (f"{radius} mm, {name}, {stepped}{words}" for stepped in ("auto", "15 µs"))
                    runs = seeds(merged(scenario, over), many)
                    yield Case(label, runs, (short,)) if step == "auto" else Case(short, runs)


def slide():
    """Slide angles of three sizes and six headings, over the moments of bonds."""
    places = [(size, heading) for size in (1, 2, 3) for heading in (0, 30, 45, 60, 90, 180)]
    for radius in (4, 5, 6):
        for friction in (0.37, 0.6):
            # A nearly rigid fillet tells whether bonds or the shape of the fillet limit the angle.
            rigid = {"normal_stiffness_n_m3": 1e8, "shear_stiffness_n_m3": 6e7, "moment_stiffness_factor": 1}
            for words, bonds in (*stiffer_bonds((0, 0.25, 1, 2, 4)), ("100 times as stiff, f = 1", rigid)):
                scenarios = {
                    f"size {size}, {heading}°": {
                        "experiment": "slide",
                        "product": {"shape": 2 * (size - 1), "subparticle_radius_m": radius / 1e3},
                        "bonds": bonds,
                        "contact": {"fillet_equipment": {"static_friction": friction}},
                        "slide": {"yaw_deg": heading},
                        "numerics": {"timestep_s": "auto"},
                    }
                    for size, heading in places
                }
                yield Case(f"{radius} mm, μ = {friction}, {words}", scenarios)
                if words in ("f = 0", "f = 1"):
                    by_volume = {place: merged(scenario, BY_VOLUME) for place, scenario in scenarios.items()}
                    yield Case(f"{radius} mm, μ = {friction}, {words}, by volume", by_volume)


def stiffer_bonds(factors):
    """Bonds with moments, and bonds along the diagonals of the faces of the lattice, with the label of each."""
    for factor in factors:
        yield f"f = {factor}", {"moment_stiffness_factor": factor}
    diagonals = {"types": 1, "contact_radius_ratio": 1.5}
    yield "diagonals", diagonals
    yield "diagonals, f = 1", {**diagonals, "moment_stiffness_factor": 1}


def bend():
    """Bend angles of size 2 over a bar of 20 mm, over the moments of bonds."""
    for radius in (4, 5, 6):
        for words, bonds in stiffer_bonds((0, 0.1, 0.25, 0.5, 1, 2)):
            scenario = {
                "experiment": "bend",
                "product": {"shape": 2, "subparticle_radius_m": radius / 1e3},
                "bonds": bonds,
                "numerics": {"timestep_s": "auto"},
            }
            yield Case(f"{radius} mm, {words}", seeds(scenario, 1))


def belt():
    """Discharge over the friction of the belt, with and without moments in bonds."""
    for friction in (0.5, 0.3, 0.2):
        for factor in (0, 1):
            over = {
                "contact": {"fillet_belt": {"static_friction": friction}},
                "bonds": {"moment_stiffness_factor": factor},
                "numerics": {"stop": {"when_jammed_s": 2.5}},
            }
            against = (f"belt friction {friction}, f = 0",) if factor else ()
            yield Case(f"belt friction {friction}, f = {factor}", seeds(merged(bed(6, 4.2), over), 5), against)


def silo():
    """Rates of the silo of solver/tests/silo; a scenario holds the options of silo.py, and the windows in which it fits the rate."""
    small = {"spheres": 50_000, "diameter": 0.004, "fill-seconds": 0.4}
    large = {"spheres": 2500, "diameter": 0.01, "fill-seconds": 0.3}
    finer = {**large, "step-share": 0.25}
    large_windows, small_windows = ((0.1, 0.4),), ((0.1, 0.3), (0.2, 0.6))
    for label, options, megapascals, seconds, windows, count, against in (
        ("10 mm, 10 MPa", large, 10, 0.45, large_windows, 8, ()),
        ("10 mm, 10 MPa, a quarter of the time step", finer, 10, 0.45, large_windows, 6, ("10 mm, 10 MPa",)),
        ("10 mm, 100 MPa", large, 100, 0.45, large_windows, 3, ("10 mm, 10 MPa",)),
        ("4 mm, 10 MPa", small, 10, 0.65, small_windows, 3, ()),
        ("4 mm, 100 MPa", small, 100, 0.35, small_windows[:1], 3, ("4 mm, 10 MPa",)),
    ):
        scenario = {"fill": {**options, "modulus": megapascals * 1e6}, "seconds": seconds, "windows": windows}
        yield Case(label, seeds(scenario, count), against)


# The default fill of this format is `centres`, as in the paper.
SCHEMA = "roost.scenario/2"


def simulate(roost, folder, scenario):
    """Responses of a scenario and the revision of the solver, from an earlier call if there is one."""
    result = folder / "result.json"
    # A simulation that was stopped leaves a result too.
    if not result.exists() or json.loads(result.read_text())["end_reason"] == "cancelled":
        document = folder / "scenario.json"
        document.write_text(json.dumps({"schema": SCHEMA, **scenario}))
        run(roost, document, folder)
    found = json.loads(result.read_text())
    return found["responses"], found["solver"]["revision"]


def empty_silo(roost, folder, options):
    """The same for a silo: the lid opens over spheres at rest."""

    def step(name, **flags):
        command = [sys.executable, SILO, name, folder, *(f"--{flag}={value}" for flag, value in flags.items())]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    if not (folder / "open/result.json").exists():
        step("fill", seed=options["seed"], **options["fill"])
        run(roost, folder / "fill.json", folder / "fill")
        step("open", seconds=options["seconds"])
        run(roost, folder / "open.json", folder / "open")
    windows = {f"rate from {start} to {end} s": {"from": start, "to": end} for start, end in options["windows"]}
    rates = {name: float(step("rate", **window).split()[1]) for name, window in windows.items()}
    return rates, json.loads((folder / "open/result.json").read_text())["solver"]["revision"]


def run(roost, document, output):
    """`roost run`, on one thread."""
    command = [roost, "run", "--backend", "cpu", "--threads", "1", "-o", output, document]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


# For each study its cases, the responses that it reports, and how it runs a scenario.
STUDIES = {
    "lattice": (lattice, ["modulus_lattice_pa"], simulate),
    "radius": (radius, ["mean_rate_kg_s", "discharged_kg_at_4s", "bulk_density_kg_m3"], simulate),
    "gates": (
        gates,
        ["mean_rate_kg_s", "discharged_kg_at_4s", "lowest_rate_ratio", "bonds_intact_fraction", "regime"],
        simulate,
    ),
    "fill": (fill, ["interpenetrated_fraction", "bulk_density_kg_m3"], simulate),
    "dropped": (dropped, ["interpenetrated_fraction"], simulate),
    "impact": (impact, ["settle_time_s", "bonds_intact_fraction"], simulate),
    "slide": (slide, ["critical_angle_deg", "rolled_over"], simulate),
    "bend": (bend, ["bend_angle_deg", "bonds_intact_fraction"], simulate),
    "belt": (belt, ["mean_rate_kg_s", "discharged_kg_at_4s", "regime"], simulate),
    "silo": (silo, ["rate from 0.1 to 0.3 s", "rate from 0.2 to 0.6 s", "rate from 0.1 to 0.4 s"], empty_silo),
}


def hash_of(scenario):
    """A number for a scenario, the same in every process."""
    text = json.dumps(scenario, sort_keys=True)
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "big")


def cell(values):
    """Mean with its 95 % interval, n and range, or the words with their numbers."""
    values = [value for value in values if value is not None]
    if not values:
        return "–"
    if isinstance(values[0], (str, bool)):
        return ", ".join(f"{word} ({values.count(word)})" for word in sorted(set(values)))
    mean, n = statistics.fmean(values), len(values)
    if n == 1:
        return f"{mean:.4g} (n = 1)"
    half = T[n - 2] * statistics.stdev(values) / math.sqrt(n)
    return f"{mean:.4g} ± {half:.2g} (n = {n}, {min(values):.4g} to {max(values):.4g})"


def pairwise(operation, of, against):
    """The operation on the numbers of two cases, replicate by replicate."""
    pairs = [(of[replicate], against[replicate]) for replicate in of if replicate in against]
    return [operation(a, b) for a, b in pairs if type(a) in (int, float) and type(b) in (int, float)]


def difference(a, b):
    return a - b


def quotient(a, b):
    return a / b if b else None


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("study", choices=STUDIES)
    arguments.add_argument("--roost", default="target/debug/roost")
    arguments.add_argument("--output", type=pathlib.Path, required=True)
    arguments.add_argument("--at-most", type=int, help="simulations of each case; all by default")
    arguments.add_argument("--csv", type=pathlib.Path)
    arguments.add_argument("--revision", type=int, help="values of this revision of the solver in the file are not simulated again")
    arguments.add_argument("--part", default="", help="text in the label of the cases that are simulated; all by default. With --revision, values of others come from the file")
    given = arguments.parse_args()
    cases, responses, run_one = STUDIES[given.study]
    known = Values(given.csv)

    def print_row(label, cells):
        print(f"| {label} | " + " | ".join(cells) + " |", flush=True)

    print_row(given.study, responses)
    print("|---" * (len(responses) + 1) + "|", flush=True)
    earlier = {}
    for case in cases():
        found = {name: {} for name in responses}
        for replicate, scenario in list(case.scenarios.items())[: given.at_most]:
            values = known.of(given.study, case.label, replicate, given.revision)
            if not values and given.part in case.label:
                folder = given.output / f"{hash_of(scenario):016x}"
                folder.mkdir(parents=True, exist_ok=True)
                values, revision = run_one(given.roost, folder, scenario)
                if given.revision not in (None, revision):
                    sys.exit(f"the solver has revision {revision}, not {given.revision}")
                values = {name: values[name] for name in responses if name in values}
                known.add(given.study, case.label, replicate, revision, values)
            for name in responses:
                found[name][replicate] = values.get(name)
        print_row(case.label, [cell(found[name].values()) for name in responses])
        for label in case.against:
            for words, operation in (("less", difference), ("over", quotient)):
                compared = (cell(pairwise(operation, found[name], earlier[label][name])) for name in responses)
                print_row(f"the same, {words} {label}", compared)
        earlier[case.label] = found


class Values:
    """The file of values, one a row."""

    COLUMNS = ["study", "case", "replicate", "response", "value", "solver_revision"]

    def __init__(self, path):
        self.path, self.rows = path, {}
        if path and path.exists():
            with path.open(newline="") as file:
                self.rows = {self.key(*row[:4], row[5]): row for row in list(csv.reader(file))[1:]}

    @staticmethod
    def key(study, case, replicate, response, revision):
        return study, int(revision), case, str(replicate), response

    def of(self, study, case, replicate, revision):
        """The values of a simulation by response; none if the file has none."""
        wanted = (study, revision, case, str(replicate))
        return {key[4]: number(row[4]) for key, row in self.rows.items() if key[:4] == wanted}

    def add(self, study, case, replicate, revision, values):
        """Adds the values of a simulation, in place of earlier ones, and writes the file."""
        for response, value in values.items():
            row = [study, case, replicate, response, value, revision]
            self.rows[self.key(study, case, replicate, response, revision)] = row
        if self.path:
            with self.path.open("w", newline="") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(self.COLUMNS)
                writer.writerows(self.rows.values())


def number(text):
    """A value of the file: a number, a truth value, a word, or nothing."""
    try:
        return float(text)
    except ValueError:
        return {"True": True, "False": False, "": None}.get(text, text)


main()
