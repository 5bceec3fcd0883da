#!/usr/bin/env python3
"""Compares `roost work --slots auto` with fixed numbers of slots: wall time of sweeps, on one machine, in turn.

    cargo build
    worker/benches/slots.py target/debug/roost [ROUNDS [SWEEP]]

Sweeps: `demo`, the four runs of `roost demo`; `slices`, 40 runs of a slice of a hopper; `hoppers`, four whole hoppers. Every run has the same bits on any number of threads, so only the
time differs. Each round runs every choice once, in an order that turns from round to round. A row is the median over the rounds, and its
ratio to the best fixed choice. Exits with 1 if `auto` takes more than 1.05 times as long as the best fixed choice.
"""
import datetime
import json
import os
import pathlib
import statistics
import sys
import tempfile
import time

from farm import Farm

ROOT = pathlib.Path(__file__).parents[2]


def slices():
    base = {"experiment": "hopper",
            "product": {"count": 12, "subparticle_radius_m": 0.006},
            "equipment": {"hopper_width_m": 0.15, "side_walls": "frictionless"},
            "numerics": {"timestep_s": "auto", "duration_s": 1.0}}
    levels = [round(0.040 + 0.004 * step, 3) for step in range(8)]
    return {"name": "slices", "base": base, "design": {"kind": "grid"}, "replicates": 5, "cache": "bypass",
            "factors": [{"pointer": "/equipment/gate_opening_m", "levels": levels}]}


def hoppers():
    base = {"experiment": "hopper", "product": {"subparticle_radius_m": 0.006}, "numerics": {"timestep_s": "auto"}}
    return {"name": "hoppers", "base": base, "design": {"kind": "grid"}, "factors": [], "replicates": 4, "cache": "bypass"}


def timed(roost, sweep, slots):
    """Seconds from the submission to the end of the last job, on a fresh server with one worker that waits for work."""
    with tempfile.TemporaryDirectory() as folder, Farm(roost, folder) as farm:
        farm.workers = [farm.worker("worker", "--slots", slots)]
        time.sleep(1)
        identifier = farm.submit(sweep)
        farm.wait(identifier)
        jobs = farm.jobs(identifier)
        moment = lambda text: datetime.datetime.fromisoformat(text).timestamp()
        return max(moment(job["ended_at"]) for job in jobs) - min(moment(job["submitted_at"]) for job in jobs)


def main():
    roost, rounds = os.path.abspath(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 5
    processors = len(os.sched_getaffinity(0))
    fixed = sorted({"1", "2", str(max(1, processors // 2)), str(processors)}, key=int)
    demo = json.loads((ROOT / "src/demo/sweep.json").read_text())
    is_good = True
    sweeps = {"demo": demo, "slices": slices(), "hoppers": hoppers()}
    for name in sys.argv[3:] or sweeps:
        sweep = sweeps[name]
        choices, times = [*fixed, "auto"], {}
        for number in range(rounds):
            turn = number % len(choices)
            for slots in choices[turn:] + choices[:turn]:
                times.setdefault(slots, []).append(timed(roost, sweep, slots))
        medians = {slots: statistics.median(values) for slots, values in times.items()}
        best = min(medians[slots] for slots in fixed)
        for slots in choices:
            every = " ".join(f"{value:.2f}" for value in times[slots])
            print(f"{name:10} slots {slots:>4}: {medians[slots]:7.2f} s, {medians[slots] / best:.3f} of the best  ({every})")
        is_good &= medians["auto"] <= 1.05 * best
    sys.exit(0 if is_good else 1)


main()
