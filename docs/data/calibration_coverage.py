#!/usr/bin/env python3
"""Coverage of the intervals of calibrations: measurements are simulated from known parameters plus noise, and calibrated.

    python3 docs/data/calibration_coverage.py ROOST FOLDER [REPETITIONS] [MAX_RUNS]

Each repetition draws four parameters from their priors, and simulates the tests slide, bend and compress with them: five replicates, as of
five fillets, with seeds and noise of their own. It runs `roost study run` on these measurements. It prints how often the 95 % intervals hold the true
parameters, and writes a row per repetition to FOLDER/coverage.csv. Repetitions that are in this table are not run again.
"""

import csv
import json
import math
import pathlib
import random
import subprocess
import sys

PARAMETERS = [
    {"pointer": "/material/youngs_modulus_pa", "low": 2e4, "high": 2e5, "scale": "log"},
    {"pointer": "/bonds/normal_stiffness_n_m3", "low": 3e5, "high": 3e6, "scale": "log"},
    {"pointer": "/bonds/shear_stiffness_n_m3", "low": 2e5, "high": 2e6, "scale": "log"},
    {"pointer": "/contact/fillet_equipment/static_friction", "low": 0.1, "high": 0.9},
]
COMMON = {"product": {"subparticle_radius_m": 0.006}, "numerics": {"timestep_s": "auto"}}
TESTS = {
    "slide": {"experiment": "slide", **COMMON},
    "bend": {"experiment": "bend", "bend": {"support": "over_bar", "bar_radius_m": 0.02}, **COMMON},
    "compress": {"experiment": "compress", **COMMON},
}
# Response and standard deviation of single replicates, as a share of the true value.
MEASURED = [("slide", "critical_angle_deg", 0.05), ("bend", "bend_angle_deg", 0.05),
            ("compress", "modulus_pa", 0.08), ("compress", "stress_at_end_pa", 0.08)]
REPLICATES = 5


def draw(chance, parameter):
    """A value of a parameter, uniform along its scale."""
    share = chance.random()
    if parameter.get("scale") == "log":
        return parameter["low"] * (parameter["high"] / parameter["low"]) ** share
    return parameter["low"] + share * (parameter["high"] - parameter["low"])


def scenario(test, truth):
    """The scenario of a test with these parameters."""
    document = json.loads(json.dumps(TESTS[test]))
    for parameter, value in zip(PARAMETERS, truth):
        place = document
        *path, last = parameter["pointer"].strip("/").split("/")
        for name in path:
            place = place.setdefault(name, {})
        place[last] = value
    return document


def simulated(roost, folder, test, truth, seed):
    """Responses of a run with the true parameters, by name."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{test}-{seed}.json"
    path.write_text(json.dumps({**scenario(test, truth), "seed": seed}))
    out = folder / f"{test}-{seed}-out"
    subprocess.run([roost, "run", path, "-o", out], check=True, capture_output=True)
    return json.loads((out / "result.json").read_text())["responses"]


def study(chance, replicates, max_runs, name):
    """The study of one repetition, with noisy measurements of the simulated replicates."""
    tests = []
    for test, base in TESTS.items():
        responses = []
        for _, response, share in (row for row in MEASURED if row[0] == test):
            values = [run[response] * (1 + share * chance.gauss(0, 1)) for run in replicates[test]]
            unit = "deg" if response.endswith("_deg") else "Pa"
            responses.append({"response": response, "unit": unit, "values": values})
        tests.append({"name": test, "scenario": base, "measured": {"responses": responses}})
    return {"schema": "roost.study/1", "name": name, "factors": PARAMETERS, "budget": {"max_runs": max_runs},
            "goal": {"calibrate": {"measurements": {"name": name, "tests": tests}}}}


def main():
    roost, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    repetitions = int(sys.argv[3]) if len(sys.argv) > 3 else 50
    max_runs = int(sys.argv[4]) if len(sys.argv) > 4 else 150
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "coverage.csv"
    rows = list(csv.DictReader(table.open())) if table.exists() else []
    done = {int(row["repetition"]) for row in rows}
    for repetition in (number for number in range(repetitions) if number not in done):
        chance = random.Random(repetition)
        # A set whose tests give no number, because the fillet fell off or broke, is no truth.
        while True:
            truth = [draw(chance, parameter) for parameter in PARAMETERS]
            place = folder / f"truth-{repetition}"
            seeds = [12345 + REPLICATES * repetition + replicate for replicate in range(REPLICATES)]
            replicates = {test: [simulated(roost, place, test, truth, seed) for seed in seeds] for test in TESTS}
            numbers = [run.get(response) for test, response, _ in MEASURED for run in replicates[test]]
            if all(isinstance(number, (int, float)) and math.isfinite(number) and number > 0 for number in numbers):
                break
        path = folder / f"study-{repetition}.json"
        path.write_text(json.dumps(study(chance, replicates, max_runs, f"repetition {repetition}")))
        out = folder / f"study-{repetition}"
        subprocess.run([roost, "study", "run", path, "-o", out], check=True, capture_output=True)
        answer = json.loads((out / "answer.json").read_text())
        finding = answer["answer"]["finding"]["calibrate"]
        row = {"repetition": repetition, "runs": answer["study"]["runs"]["done"], "end": answer["study"]["finished"],
               "emulator_share": finding["emulator_share"], "r_hat": finding["r_hat"]}
        for parameter, true, found in zip(PARAMETERS, truth, finding["parameters"]):
            name = parameter["pointer"].rsplit("/", 1)[1]
            low, high = found["estimate"]["low"], found["estimate"]["high"]
            row |= {f"{name}_true": true, f"{name}_low": low, f"{name}_high": high,
                    f"{name}_held": int(low <= true <= high), f"{name}_remaining": found["remaining"]}
        row["pairs"] = "; ".join(" + ".join(pair["parameters"]) for pair in finding["pairs"])
        rows.append(row)
        with table.open("w", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=row)
            writer.writeheader()
            writer.writerows(rows)
        print(json.dumps(row), flush=True)
    for parameter in PARAMETERS:
        name = parameter["pointer"].rsplit("/", 1)[1]
        held = sum(int(row[f"{name}_held"]) for row in rows)
        remaining = sorted(float(row[f"{name}_remaining"]) for row in rows)[len(rows) // 2]
        print(f"{name}: held in {held} of {len(rows)}, median remaining deviation {remaining:.2f}")
    held = sum(int(row[key]) for row in rows for key in row if key.endswith("_held"))
    print(f"all: {held} of {4 * len(rows)} intervals hold the truth, at most {max(int(row['runs']) for row in rows)} runs")


if __name__ == "__main__":
    main()
