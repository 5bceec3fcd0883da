"""Makes a stored database for the upgrade test: a server and a worker of one version, at work, and what the server answers about it.

    ROOST=/path/to/that/roost python3 make.py 0.1.0     # in an empty folder; leaves 0.1.0.sql and 0.1.0.json

The database holds jobs in every state (the running one is frozen with its worker), a sweep that was extended, one that waits, one that
was deleted, frames, a mesh, an answer from the store, and a submission under an Idempotency-Key. It holds no token.
"""

import json, subprocess, time, urllib.request, os, signal, sqlite3, struct, sys

ROOST = os.environ["ROOST"]
PORT = 17999
R = f"http://127.0.0.1:{PORT}"


def serve():
    p = subprocess.Popen(
        [ROOST, "serve", "--listen", f"127.0.0.1:{PORT}", "--data", "data", "--lease-s", "60"],
        stdout=subprocess.DEVNULL,
        stderr=open("serve.log", "a"),
    )
    for _ in range(200):
        try:
            urllib.request.urlopen(R + "/healthz")
            return p
        except Exception:
            time.sleep(0.05)
    raise SystemExit("no server")


def call(path, body=None, headers={}, method=None):
    h = dict(headers)
    data = None
    if body is not None:
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        h.setdefault("content-type", "application/json")
    req = urllib.request.Request(
        R + path, data=data, headers=h, method=method or ("POST" if body is not None else "GET")
    )
    try:
        return json.load(urllib.request.urlopen(req))
    except urllib.error.HTTPError as e:
        raise SystemExit(f"{path}: {e.code} {e.read().decode()}")


def scenario(seed=1, **more):
    s = {
        "experiment": "hopper",
        "seed": seed,
        "product": {"count": 2, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "duration_s": 0.1, "stop": {"when_empty": False}},
    }
    s.update(more)
    return s


def when(id, *states):
    for _ in range(1200):
        j = call("/v1/jobs/" + id)
        if j["state"] in states:
            return j
        time.sleep(0.05)
    raise SystemExit(f"{id} {j}")


p = serve()


def worker(name):
    return subprocess.Popen(
        [ROOST, "work", "--server", R, "--state", "state", "--threads", "1", "--backend", "cpu", "--name", name],
        stderr=open("work.log", "a"),
    )


sweep = call(
    "/v1/sweeps",
    {
        "name": "gate by belt",
        "labels": {"line": "4", "shift": "night"},
        "base": scenario(),
        "design": {"kind": "grid"},
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06]}],
        "replicates": 2,
    },
    {"idempotency-key": "once"},
)
gone = call("/v1/sweeps", {"name": "gone", "base": scenario(9), "design": {"kind": "grid"}})
single = call("/v1/jobs", {"scenario": scenario(5), "labels": {"who": "a user"}, "frame_interval_s": 0.05})
bend = call(
    "/v1/jobs", {"scenario": scenario(3, numerics={"timestep_s": 0.02, "allow_unstable": True, "duration_s": 0.4})}
)
w = worker("old worker")
for _ in range(1200):
    s = call("/v1/sweeps/" + sweep["id"])
    if s["counts"]["succeeded"] == 4:
        break
    time.sleep(0.05)
call(f"/v1/sweeps/{sweep['id']}/extend", {"replicates": 3})
for _ in range(1200):
    s = call("/v1/sweeps/" + sweep["id"])
    if s["counts"]["succeeded"] == 10:
        break
    time.sleep(0.05)
else:
    raise SystemExit(s)
when(single["id"], "succeeded")
b = when(bend["id"], "failed", "succeeded")
print("drop:", b["state"], b["failure_class"])
call(f"/v1/sweeps/{gone['id']}", None, method="DELETE")
cached = call("/v1/jobs", {"scenario": scenario(5)})
when(cached["id"], "succeeded")
# a running job, frozen with its worker
running = call(
    "/v1/jobs",
    {
        "scenario": scenario(6, numerics={"timestep_s": 2e-5, "duration_s": 600.0, "stop": {"when_empty": False}}),
        "priority": 7,
        "max_wall_s": 86400,
    },
)
when(running["id"], "running")
time.sleep(1)
w.send_signal(signal.SIGSTOP)
waiting = call("/v1/jobs", {"scenario": scenario(7), "priority": -2, "needs": {"backend": "cpu", "memory_mib": 12}})
cancelled = call("/v1/jobs", {"scenario": scenario(8)})
call(f"/v1/jobs/{cancelled['id']}/cancel", b"")


# a closed block as STL
def stl(dx, dy, dz):
    v = [(x * dx, y * dy, z * dz) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    f = [
        (0, 1, 3),
        (0, 3, 2),
        (4, 6, 7),
        (4, 7, 5),
        (0, 4, 5),
        (0, 5, 1),
        (2, 3, 7),
        (2, 7, 6),
        (0, 2, 6),
        (0, 6, 4),
        (1, 5, 7),
        (1, 7, 3),
    ]
    out = b"\0" * 80 + struct.pack("<I", 12)
    for t in f:
        out += struct.pack("<3f", 0, 0, 0) + b"".join(struct.pack("<3f", *v[i]) for i in t) + b"\0\0"
    return out


mesh = call("/v1/meshes", stl(120, 60, 30), {"content-type": "model/stl"})
two = call(
    "/v1/sweeps",
    {
        "name": "two belts",
        "priority": 3,
        "base": scenario(11),
        "design": {"kind": "sobol", "points": 3, "seed": 1},
        "factors": [{"pointer": "/equipment/belt_speed_m_s", "low": 0.1, "high": 0.3}],
    },
)
p.terminate()
p.wait()
w.kill()
w.wait()
p = serve()
paths = ["/v1/jobs?limit=500", "/v1/sweeps", "/v1/workers", "/v1/meshes"]
jobs = [j["id"] for j in call("/v1/jobs?limit=500")["items"]]
for j in jobs:
    v = call("/v1/jobs/" + j)
    paths.append("/v1/jobs/" + j)
    if v["state"] == "succeeded":
        paths += [f"/v1/jobs/{j}/result"]
for s in call("/v1/sweeps")["items"]:
    paths += [
        f"/v1/sweeps/{s['id']}" + x
        for x in ("", "/jobs", "/spec", "/results?format=json", "/results?by=point", "/effects")
    ]
answers = {}
for path in paths:
    try:
        answers[path] = call(path)
    except SystemExit as e:
        print("left out", e)
p.terminate()
p.wait()
version = sys.argv[1]
with open(version + ".json", "w") as f:
    rows = (
        json.dumps(path) + ": " + json.dumps(answer, ensure_ascii=False, separators=(",", ":"))
        for path, answer in answers.items()
    )
    f.write("{\n" + ",\n".join(rows) + "\n}\n")
db = sqlite3.connect("data/roost.db")
with open(version + ".sql", "w") as f:
    for line in db.iterdump():
        f.write(line + "\n")
