#!/usr/bin/env python3
"""Compares a sweep of hoppers whose jobs share filled states with the same sweep without: wall time, processor time, and bits.

    cargo build
    worker/benches/fills.py target/debug/roost [GATES [BELTS [SEEDS [RADIUS_M]]]]

A server, and two workers with one thread each. Each way has a fresh server and fresh workers. Exits with 1 if a job has other bits, or if
the sweep with shared fills is not 1.4 times as fast.
"""
import json
import os
import resource
import sys
import tempfile
import time

from farm import Farm

LIMIT = 1.4


def sweep(gates, belts, seeds, radius_m, is_shared):
    return {"name": "fills", "cache": "bypass", "shared_fill": is_shared, "design": {"kind": "grid"}, "replicates": seeds,
            "base": {"experiment": "hopper", "product": {"subparticle_radius_m": radius_m}, "numerics": {"timestep_s": "auto"}},
            "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [round(0.045 + 0.005 * step, 3) for step in range(gates)]},
                        {"pointer": "/equipment/belt_speed_m_s", "levels": [round(0.2 + 0.05 * step, 2) for step in range(belts)]}]}


def processor_time_s():
    """Processor time of all processes that this one has started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measured(roost, document):
    """Wall time and processor time in seconds, and by job the outcome that must not differ."""
    began_s = processor_time_s()
    with tempfile.TemporaryDirectory() as folder:
        with Farm(roost, folder) as farm:
            identifier, started = farm.submit(document), time.monotonic()
            farm.workers = [farm.worker(f"worker-{number}", "--slots", "1", "--threads", "1") for number in range(2)]
            farm.wait(identifier)
            wall_s, outcomes, filled_by_another = time.monotonic() - started, {}, 0
            for job in farm.jobs(identifier):
                result = farm.get(f"/v1/jobs/{job['id']}/result")
                key = json.dumps(result["scenario"], sort_keys=True)
                outcomes[key] = json.dumps([result[part] for part in ["responses", "series", "curves", "end_reason"]])
                filled_by_another += job.get("filled_by") == "shared"
        return wall_s, processor_time_s() - began_s, outcomes, filled_by_another


def main():
    roost = os.path.abspath(sys.argv[1])
    gates, belts, seeds = [int(argument) for argument in sys.argv[2:5]] + [8, 5, 5][len(sys.argv[2:5]):]
    radius_m = float(sys.argv[5]) if len(sys.argv) > 5 else 0.006
    times, outcomes = {}, {}
    for is_shared in (True, False):
        wall_s, processor_s, outcomes[is_shared], reused = measured(roost, sweep(gates, belts, seeds, radius_m, is_shared))
        times[is_shared] = wall_s, processor_s
        print(f"{'shared fills' if is_shared else 'fills of their own':18}: {wall_s:7.1f} s, processor {processor_s:7.1f} s, "
              f"{len(outcomes[is_shared])} jobs, {reused} with a fill of another job", flush=True)
    same = sum(outcomes[True][key] == outcomes[False].get(key) for key in outcomes[True])
    ratios = [times[False][part] / times[True][part] for part in (0, 1)]
    print(f"ratio of wall times {ratios[0]:.2f}, of processor times {ratios[1]:.2f}; {same} of {len(outcomes[True])} jobs have the same bits")
    is_good = same == len(outcomes[True]) == gates * belts * seeds and ratios[0] >= LIMIT
    sys.exit(0 if is_good else 1)


if __name__ == "__main__":
    main()
