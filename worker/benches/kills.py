#!/usr/bin/env python3
"""Kills workers while they run jobs with checkpoints, and measures the work that is lost.

    cargo build
    worker/benches/kills.py target/debug/roost [KILLS [SECONDS [CHECKED [REPLICATES]]]]

A server, and two workers with one thread each. Every 11.5 s one of them is killed with SIGKILL and started again. Checkpoints are uploaded
every 10 s. The time lost by a kill is that from the moment at which the job was as far as its next attempt begins, to the kill. At
the end, some jobs are simulated again without kills. Exits with 1 if a job is lost or has other bits, or if a kill lost more than 15 s.
"""
import json
import os
import pathlib
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time

from farm import Farm

INTERVAL_S = 11.5
LIMIT_S = 15.0

BASE = {"experiment": "hopper",
        "product": {"count": 96, "subparticle_radius_m": 0.005},
        "equipment": {"hopper_width_m": 0.4, "side_walls": "frictionless"},
        "numerics": {"timestep_s": 1e-4, "duration_s": 6.0, "stop": {"when_empty": False}}}
GATES = [round(0.045 + 0.005 * step, 3) for step in range(4)]


OPTIONS = ["--lease-s", "5", "--heartbeat-s", "1", "--checkpoint-interval", "10s", "--lost-attempts", "0", "--retry-pause-s", "0"]


def worker(farm, number):
    return farm.worker(f"worker-{number}", "--slots", "1", "--threads", "1")


class Follower:
    """The progress of attempts, and the kills whose next attempt has not begun."""

    def __init__(self):
        self.samples, self.open, self.lost_s = {}, [], []

    def observe(self, jobs):
        now = time.monotonic()
        for job in jobs:
            progress = job.get("progress")
            if job["state"] == "running" and progress:
                self.samples.setdefault((job["id"], job["attempt"]), []).append((now, progress["simulated_s"]))
        for kill in list(self.open):
            killed_at, identifier, attempt = kill
            job = next(job for job in jobs if job["id"] == identifier)
            if job["attempt"] > attempt and job["state"] == "running":
                self.open.remove(kill)
                self.lost_s.append(self.lost(killed_at, identifier, attempt, job.get("resumed_from_s") or 0.0))

    def lost(self, killed_at, identifier, attempt, resumed_from_s):
        """Seconds from the moment at which the attempt was as far as the next one begins, or from its first progress."""
        samples = self.samples.get((identifier, attempt), [])
        if not samples:
            return 0.0
        before = [moment for moment, simulated_s in samples if simulated_s <= resumed_from_s]
        return killed_at - (before[-1] if before else samples[0][0])


def undisturbed(roost, folder, job):
    """Whether a run without kills has the same responses, series and curves."""
    scenario = pathlib.Path(folder, "again.json")
    scenario.write_text(json.dumps(job["scenario"]))
    output = pathlib.Path(folder, f"again-{job['id']}")
    subprocess.run([roost, "run", scenario, "-o", output, "--threads", "1", "--no-shared-fill"], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    again = json.loads((output / "result.json").read_text())
    return all(again[part] == job["result"][part] for part in ["responses", "series", "curves", "end_reason"])


def main():
    numbers = [int(argument) for argument in sys.argv[2:]] + [100, 1200, 6, 5][len(sys.argv) - 2:]
    kills, seconds, checked, replicates = numbers
    roost, chance = os.path.abspath(sys.argv[1]), random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        follower = Follower()
        with Farm(roost, folder, *OPTIONS) as farm:
            farm.workers = [worker(farm, number) for number in range(2)]
            sweep = farm.submit({"name": "kills", "base": BASE, "design": {"kind": "grid"}, "replicates": replicates, "cache": "bypass",
                                 "shared_fill": False, "factors": [{"pointer": "/equipment/gate_opening_m", "levels": GATES}]})
            began, done, idle = time.monotonic(), 0, 0
            while True:
                jobs = farm.jobs(sweep)
                follower.observe(jobs)
                if all(job["state"] in ("succeeded", "failed", "cancelled") for job in jobs):
                    break
                elapsed = time.monotonic() - began
                if done < kills and elapsed < seconds and elapsed >= (done + 1) * INTERVAL_S:
                    number = chance.randrange(2)
                    names = {worker["id"]: worker["name"] for worker in farm.get("/v1/workers")["items"]}
                    running = [job for job in jobs if job["state"] == "running"
                               and names.get(job.get("worker_id")) == f"worker-{number}"]
                    farm.workers[number].send_signal(signal.SIGKILL)
                    farm.workers[number].wait()
                    idle += not running
                    follower.open += [(time.monotonic(), job["id"], job["attempt"]) for job in running]
                    farm.workers[number] = worker(farm, number)
                    done += 1
                    print(f"{elapsed:6.0f} s: kill {done}, {sum(job['state'] == 'succeeded' for job in jobs)} of {len(jobs)} done",
                          file=sys.stderr)
                time.sleep(0.5)
            states = [job["state"] for job in jobs]
            chosen = chance.sample(sorted(jobs, key=lambda job: -job["attempt"])[:2 * checked], checked)
            for job in chosen:
                job["result"] = farm.get(f"/v1/jobs/{job['id']}/result")
                job["scenario"] = job["result"]["scenario"]
        same = sum(undisturbed(roost, folder, job) for job in chosen)
        lost = sorted(follower.lost_s)
        part = lambda share: lost[min(len(lost) - 1, int(share * len(lost)))] if lost else 0.0
        print(f"{done} kills in {time.monotonic() - began:.0f} s, {idle} of them between jobs; "
              f"{states.count('succeeded')} of {len(states)} jobs succeeded, {sum(job['attempt'] for job in jobs)} attempts")
        if lost:
            print(f"lost by a kill (n = {len(lost)}): median {statistics.median(lost):.1f} s, "
                  f"90 % {part(0.9):.1f} s, maximum {lost[-1]:.1f} s")
        print(f"{same} of {len(chosen)} jobs with most attempts have the bits of an undisturbed run")
        good = states.count("succeeded") == len(states) and same == len(chosen) and (not lost or lost[-1] <= LIMIT_S)
        sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
