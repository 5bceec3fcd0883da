"""A study without workers: ask for runs, evaluate them here, and tell their outcomes.

    python3 ask-tell.py http://127.0.0.1:7373

A server with tokens takes one from the variable ROOST_TOKEN.
"""

import json
import math
import os
import random
import sys
import urllib.request

GATE = "/equipment/gate_opening_m"

QUESTION = {
    "name": "a known boundary",
    "base": {"experiment": "hopper", "product": {"count": 48, "subparticle_radius_m": 0.008}},
    "factors": [{"pointer": GATE, "low": 0.03, "high": 0.09}],
    "goal": {"boundary": {"of": {"probability": "jammed"}, "level": 0.5, "misclassified": 0.05}},
    "budget": {"max_runs": 400},
    "driver": "client",
}


def post(path, document):
    """The answer of the server to a document."""
    headers = {"content-type": "application/json"}
    if "ROOST_TOKEN" in os.environ:
        headers["authorization"] = f"Bearer {os.environ['ROOST_TOKEN']}"
    request = urllib.request.Request(sys.argv[1] + path, json.dumps(document).encode(), headers)
    with urllib.request.urlopen(request) as answer:
        return json.load(answer)


def evaluate(values, seed):
    """A known function in place of an experiment: at a gate opening of 0.055 m, half of the runs jam."""
    probability = 1 / (1 + math.exp((values[GATE] - 0.055) / 0.004))
    return {"jammed": random.Random(seed).random() < probability}


study = post("/v1/studies", QUESTION)
while study["state"] == "running":
    asked = post(f"/v1/studies/{study['id']}/ask", {"count": 10})
    outcomes = [{"run": run["run"], "responses": evaluate(run["values"], run["seed"])} for run in asked["runs"]]
    study = post(f"/v1/studies/{study['id']}/tell", {"outcomes": outcomes})["study"]
print(*study["answer"], sep="\n")
