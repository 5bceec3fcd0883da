#!/usr/bin/env python3
"""Kills the server and the workers of a study, and holds its proposals to those of servers that nobody disturbs.

    cargo build
    worker/benches/study_kills.py target/debug/roost [KILLS [SECONDS_BETWEEN]]

A server and two workers with one thread each. After each pause one of the three is killed with SIGKILL and started again. Whenever the
server is dead, its data is copied twice. On each copy a server without workers runs: one undisturbed, the other killed twice while it
decides. Both must propose the same runs. At the end: no run twice, no result lost, and the answer that an undisturbed server gives from
the same results. Exits with 1 otherwise.
"""
import os
import random
import shutil
import signal
import sys
import tempfile
import time

from farm import Farm

OPTIONS = ["--heartbeat-s", "1", "--lost-attempts", "0", "--retry-pause-s", "0"]

# The workers of a copy never come back: their runs stay in flight while proposals are compared.
LONG = ["--lease-s", "600", *OPTIONS]

QUESTION = {"name": "kills", "cache": "bypass",
            "base": {"experiment": "hopper", "product": {"count": 48, "subparticle_radius_m": 0.008},
                     "equipment": {"hopper_width_m": 0.15, "side_walls": "frictionless"},
                     "numerics": {"timestep_s": "auto", "stop": {"when_jammed_s": 1}}},
            "factors": [{"pointer": "/equipment/gate_opening_m", "low": 0.03, "high": 0.1},
                        {"pointer": "/contact/fillet_belt/static_friction", "low": 0.1, "high": 0.8}],
            "goal": {"boundary": {"of": {"probability": "jammed"}, "level": 0.2, "misclassified": 1e-4}},
            "budget": {"max_runs": 5000}}


def worker(farm, number):
    return farm.worker(f"worker-{number}", "--slots", "1", "--threads", "1")


def runs(farm, study):
    """The runs of a study: gate opening, friction, replicate and seed, with the state."""
    columns = ["/equipment/gate_opening_m", "/contact/fillet_belt/static_friction"]
    found = {}
    for trial in farm.trials(study):
        key = (*(trial["factors"][name] for name in columns), trial["replicate"], trial["seed"])
        if key in found:
            raise SystemExit(f"a run was proposed twice: {key}")
        found[key] = trial["state"]
    return found


def settled(farm, study):
    """The runs once the server proposes no further ones: it keeps a few in the queue."""
    before = None
    while True:
        now = runs(farm, study)
        if now == before:
            return now
        before = now
        time.sleep(1.0)


def compare(roost, data, study, chance):
    """Whether two servers on copies of the data propose the same. The second one is killed twice."""
    proposed = []
    for kills in (0, 2):
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(data, f"{folder}/data")
            for _ in range(kills):
                with Farm(roost, folder, *LONG) as farm:
                    time.sleep(chance.uniform(0.0, 0.5))
                    farm.server.send_signal(signal.SIGKILL)
                    farm.server.wait()
            with Farm(roost, folder, *LONG) as farm:
                proposed.append(settled(farm, study).keys())
    return proposed[0] == proposed[1]


def main():
    roost, chance = os.path.abspath(sys.argv[1]), random.Random(1)
    kills, pause_s = [int(argument) for argument in sys.argv[2:]] + [50, 6][len(sys.argv) - 2:]
    same = compared = 0
    with tempfile.TemporaryDirectory() as folder:
        with Farm(roost, folder, "--lease-s", "5", *OPTIONS) as farm:
            farm.workers = [worker(farm, number) for number in range(2)]
            study = farm.submit(QUESTION, "studies")
            for kill in range(kills):
                time.sleep(chance.uniform(0.5, 1.5) * pause_s)
                victim = chance.randrange(3)
                process = farm.server if victim == 2 else farm.workers[victim]
                process.send_signal(signal.SIGKILL)
                process.wait()
                if victim < 2:
                    farm.workers[victim] = worker(farm, victim)
                    continue
                with tempfile.TemporaryDirectory() as copy:
                    shutil.copytree(f"{folder}/data", f"{copy}/data")
                    farm.start_server()
                    if compared < 10:
                        compared += 1
                        same += compare(roost, f"{copy}/data", study, chance)
                print(f"kill {kill + 1}: {len(runs(farm, study))} runs, {same} of {compared} comparisons equal", file=sys.stderr)
            found = runs(farm, study)
            lost = [job for job in farm.jobs(study) if job["state"] not in ("succeeded", "running", "queued")]
            done = sum(state == "succeeded" for state in found.values())
            results = farm.get(f"/v1/studies/{study}")["runs"]["done"]
    print(f"{kills} kills: {len(found)} runs, none twice; {done} with a result, {len(lost)} lost; "
          f"{same} of {compared} comparisons of proposals equal")
    sys.exit(0 if same == compared and not lost and done <= results <= len(found) else 1)


if __name__ == "__main__":
    main()
