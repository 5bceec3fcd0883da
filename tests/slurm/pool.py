#!/usr/bin/env python3
"""A sweep through `roost pool slurm`, half of whose allocations are cancelled: called by pool.sh, with a running Slurm and server.

    pool.py ROOST FOLDER JOBS

Every second allocation is cancelled with scancel after 5 to 15 s of work, unless it has ended before. Progress of all jobs is read twice a second. At the end, the
attempts in the database say how each ended and from which simulated second it began. A second counts as repeated if an attempt was seen to be
further than its successor began. Some jobs with many attempts are simulated again, and must have the same bits. Exits with 1 on any fault.
"""
import collections
import json
import os
import pathlib
import random
import sqlite3
import subprocess
import sys
import time
import urllib.request

ROOST, FOLDER, JOBS = sys.argv[1], pathlib.Path(sys.argv[2]), int(sys.argv[3])
SERVER = os.environ["ROOST_SERVER"]
TOKEN = (FOLDER / "admin.token").read_text().strip()
DURATION_S = float(os.environ.get("DURATION_S", "8"))
BASE = {"experiment": "hopper", "product": {"count": 2, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless", "belt_speed_m_s": 0.005},
        "numerics": {"timestep_s": 2e-5, "duration_s": DURATION_S, "stop": {"when_empty": False}}}
SWEEP = {"name": "pool", "base": BASE, "replicates": JOBS, "factors": [], "design": {"kind": "grid"}, "cache": "bypass",
         "shared_fill": False}
POOL = ["pool", "slurm", "--token-file", str(FOLDER / "pool.token"), "--backlog", "4", "--max-workers", "4", "--idle-timeout", "20s",
        "--time-limit", "1m", "--grace", "0", "--interval", "2s", "--start-within", "10s", "--state", str(FOLDER / "pool"), "--",
        "--partition=main", "--mem=0"]


def get(path):
    request = urllib.request.Request(SERVER + path, headers={"authorization": f"Bearer {TOKEN}"})
    for tries_left in reversed(range(5)):
        try:
            with urllib.request.urlopen(request, timeout=30) as answer:
                return json.load(answer)
        except OSError as error:  # a busy machine may need longer; every other failure is a fault
            if not tries_left or not isinstance(getattr(error, "reason", error), TimeoutError):
                raise
            time.sleep(2)


def roost(*words):
    command = [ROOST, *words, "--token-file", str(FOLDER / "admin.token")]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def running():
    """Ids of running allocations. Slurm shows those that are being cancelled as completing."""
    lines = subprocess.run(["squeue", "--noheader", "--states=RUNNING", "--format=%i"], check=True, capture_output=True, text=True)
    return [int(line) for line in lines.stdout.split()]


def same_bits(job):
    """Whether a run without stops has the same responses, series and curves."""
    result = get(f"/v1/jobs/{job}/result")
    scenario = FOLDER / "again.json"
    scenario.write_text(json.dumps(result["scenario"]))
    output = FOLDER / f"again-{job}"
    subprocess.run([ROOST, "run", scenario, "-o", output, "--threads", "1", "--no-shared-fill"], check=True, capture_output=True)
    again = json.loads((output / "result.json").read_text())
    return all(again[part] == result[part] for part in ["responses", "series", "curves", "end_reason"])


def main():
    random.seed(1)
    sweep_file = FOLDER / "sweep.json"
    sweep_file.write_text(json.dumps(SWEEP))
    sweep = json.loads(roost("submit", "--json", str(sweep_file)))["id"]
    log = open(FOLDER / "pool.log", "w", encoding="utf-8")
    pool = subprocess.Popen([ROOST, *POOL], stdout=log, stderr=log)
    began, seen, cancelled = time.monotonic(), {}, {}
    furthest, largest = {}, 0
    while True:
        counts = get(f"/v1/sweeps/{sweep}")["counts"]
        for job in get(f"/v1/sweeps/{sweep}/jobs?state=running&limit=100")["items"]:
            if job["progress"]:
                key = (job["id"], job["attempt"])
                furthest[key] = max(furthest.get(key, 0.0), job["progress"]["simulated_s"])
        now, live = time.monotonic(), running()
        largest = max(largest, len(live))
        for allocation in live:
            if allocation not in seen:
                seen[allocation] = now
                if len(seen) % 2:
                    cancelled[allocation] = now + random.uniform(5, 15)
        for allocation, moment in list(cancelled.items()):
            if moment and now >= moment and allocation in live:
                subprocess.run(["scancel", str(allocation)], check=True)
                cancelled[allocation] = None
        if counts["succeeded"] + counts["failed"] == JOBS:
            break
        if pool.poll() is not None or now - began > 3600:
            sys.exit(f"the pool ended ({pool.returncode}), or an hour is over; see {FOLDER}/pool.log")
        time.sleep(0.5)
    sweep_s = time.monotonic() - began
    # Idle workers end, and the pool cancels what waits.
    while subprocess.run(["squeue", "--noheader"], check=True, capture_output=True, text=True).stdout.strip():
        time.sleep(1)
    empty_s = time.monotonic() - began - sweep_s
    time.sleep(3)
    listed = subprocess.run([ROOST, "pool", "list", "--state", str(FOLDER / "pool")], check=True, capture_output=True, text=True)
    pool.terminate()
    pool.wait()

    database = sqlite3.connect(f"file:{FOLDER}/data/roost.db?mode=ro", uri=True)
    rows = database.execute("SELECT job_id, number, outcome, resumed_from_s FROM attempts ORDER BY job_id, number").fetchall()
    results = database.execute("SELECT count(*), count(DISTINCT id) FROM jobs WHERE state = 'succeeded'").fetchone()
    outcomes = collections.Counter(outcome for _, _, outcome, _ in rows)
    repeated, after_checkpoint = {}, {}
    for (job, number, outcome, _), (next_job, _, _, resumed_from_s) in zip(rows, rows[1:]):
        if next_job == job:
            seen_s = furthest.get((job, number), 0.0)
            lost_s = max(0.0, seen_s - (resumed_from_s or 0.0))
            (repeated if outcome == "preempted" else after_checkpoint)[(job, number)] = lost_s
    resumed = sum(1 for *_, resumed_from_s in rows if resumed_from_s)
    did_cancel = sum(1 for moment in cancelled.values() if moment is None)
    print(f"{results[0]} of {JOBS} jobs succeeded, {results[1]} of them different, in {sweep_s:.0f} s; Slurm's queue empty {empty_s:.0f} s later")
    print(f"allocations that ran: {len(seen)}, cancelled while they ran: {did_cancel}, at most {largest} at once")
    print("attempts:", ", ".join(f"{count} {outcome}" for outcome, count in sorted(outcomes.items())), f"({len(rows)} in all)")
    print(f"attempts that continued from a checkpoint: {resumed}")
    print(f"simulated time: {JOBS * DURATION_S:.0f} s of jobs; repeated after preempted attempts: {sum(repeated.values()):.3f} s, "
          f"after others: {sum(after_checkpoint.values()):.3f} s")
    print(listed.stdout)
    jobs = collections.Counter(job for job, *_ in rows)
    checked = [job for job, count in jobs.most_common(4) if count > 1]
    same = [same_bits(job) for job in checked]
    print(f"simulated again without stops: {len(same)} jobs of {', '.join(str(jobs[job]) for job in checked)} attempts; "
          f"same bits: {sum(same)}")
    faults = [results[0] != JOBS, sum(repeated.values()) > 0, not all(same), did_cancel * 3 < len(seen)]
    print((FOLDER / "pool.log").read_text())
    sys.exit(any(faults))


main()
