#!/usr/bin/env python3
"""The cost of checkpoints: a hopper of 41,000 sub-particles that is saved every second, beside the same run without checkpoints, in turn.

    cargo build
    worker/benches/checkpoints.py target/debug/roost [ROUNDS]

Every run uses all cores and fills its own hopper. The cost of a checkpoint is the difference of the medians of the wall time,
divided by the number of checkpoints. Exits with 1 if a checkpoint every 30 s would cost more than 1 %.
"""
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

LIMIT = 0.01
INTERVAL_S = 30.0
SCENARIO = {"experiment": "hopper", "numerics": {"timestep_s": "auto", "duration_s": 3.0, "stop": {"when_empty": False}},
            "product": {"subparticle_radius_m": 0.0049}}


def timed(roost, folder, scenario, name, *options):
    """Wall time of the run in seconds, into an output folder of its own."""
    before = time.monotonic()
    subprocess.run([roost, "run", scenario, "-o", pathlib.Path(folder, name), "--no-shared-fill", *options],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.monotonic() - before


def main():
    roost, rounds = os.path.abspath(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 5
    with tempfile.TemporaryDirectory() as folder:
        scenario = pathlib.Path(folder, "scenario.json")
        scenario.write_text(json.dumps(SCENARIO))
        without, saved = [], []
        for number in range(rounds):
            turn = [(without, []), (saved, ["--checkpoint-every", "1s"])]
            for times, options in turn if number % 2 == 0 else reversed(turn):
                times.append(timed(roost, folder, scenario, f"run-{number}-{len(options)}", *options))
    count = int(statistics.median(saved))
    cost_s = (statistics.median(saved) - statistics.median(without)) / count
    print(f"without checkpoints: {statistics.median(without):.2f} s ({' '.join(f'{value:.2f}' for value in without)})")
    print(f"saved every second:  {statistics.median(saved):.2f} s ({' '.join(f'{value:.2f}' for value in saved)})")
    print(f"a checkpoint costs {1000 * cost_s:.0f} ms; every {INTERVAL_S:.0f} s that is {100 * cost_s / INTERVAL_S:.2f} % of the wall time")
    sys.exit(0 if cost_s / INTERVAL_S <= LIMIT else 1)


if __name__ == "__main__":
    main()
