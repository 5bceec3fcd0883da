#!/usr/bin/env python3
"""A farm whose objects are in a bucket of Ceph's radosgw: called by radosgw.sh, with a running monitor and disk.

    radosgw.py ROOST FOLDER ADDRESS

Starts the gateway, a server and a worker. Disturbs them in turns while jobs run, and then checks that nothing is lost: every job has
succeeded, every object that the database names is in the bucket with the digest of its name, and two results have the bits of undisturbed
runs. Exits with 1 on any fault.
"""
import json
import os
import pathlib
import signal
import sqlite3
import subprocess
import sys
import time
import urllib.error
import urllib.request
import uuid

import blake3
import boto3

ROOST, FOLDER, S3 = sys.argv[1], pathlib.Path(sys.argv[2]), sys.argv[3]
PORT = int(os.environ.get("ROOST_PORT", "27395"))
SERVER = f"http://127.0.0.1:{PORT}"
OUTAGE_S = float(os.environ.get("OUTAGE_S", "60"))
BUCKET, PREFIX = "roost-farm", "line/north"
MAGIC = b"ROOSTF\r\n"  # of a stream of frames
KEYS = {"AWS_ENDPOINT_URL": S3, "AWS_ALLOW_HTTP": "true", "AWS_REGION": "us-east-1", "AWS_ACCESS_KEY_ID": "roost-key",
        "AWS_SECRET_ACCESS_KEY": "roost-secret"}
ALL = ["s3:GetObject", "s3:ListBucket", "s3:PutObject", "s3:DeleteObject", "s3:AbortMultipartUpload", "s3:ListMultipartUploadParts"]
HOPPER = {"experiment": "hopper", "product": {"count": 4, "subparticle_radius_m": 0.009},
          "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
          "numerics": {"timestep_s": "auto", "duration_s": 0.5, "rest_speed_m_s": 0.05, "stop": {"when_empty": False}}}
PLATES = {"hopper": [[(-0.3, -0.1, 0), (0, 0.2, 0), (0, 0, 0.5)], [(0, -0.1, 0.06), (0, 0.2, 0), (0, 0, 0.44)],
                     [(-0.3, -0.1, 0), (0.3, 0, 0), (0, 0, 0.5)], [(-0.3, 0.1, 0), (0.3, 0, 0), (0, 0, 0.5)]]}
started = {}
faults = []


def start(name, command, environment=None):
    log = open(FOLDER / f"{name}.log", "a", encoding="utf-8")
    started[name] = subprocess.Popen(command, stdout=log, stderr=log, env=dict(os.environ, **(environment or {})))
    return started[name]


def stop(name, signal_number=signal.SIGTERM):
    process = started.pop(name)
    process.send_signal(signal_number)
    process.wait()


def until(what, condition, limit_s=900):
    began = time.monotonic()
    while not condition():
        if time.monotonic() - began > limit_s:
            raise TimeoutError(what)
        time.sleep(0.3)


def check(is_right, what):
    print("  " + ("" if is_right else "FAULT: ") + what, flush=True)
    if not is_right:
        faults.append(what)


def http(path, address=SERVER):
    """Status, body and seconds of an answer."""
    began = time.monotonic()
    try:
        with urllib.request.urlopen(address + path, timeout=120) as answer:
            status, body = answer.status, answer.read()
    except urllib.error.HTTPError as error:
        status, body = error.code, error.read()
    except OSError:
        status, body = 0, b""
    return status, body, time.monotonic() - began


def get(path):
    status, body, _ = http(path)
    assert status == 200, (path, status, body)
    return json.loads(body)


def roost(*words):
    return subprocess.run([ROOST, *map(str, words)], check=True, capture_output=True, text=True, env=dict(os.environ, ROOST_SERVER=SERVER))


def start_gateway():
    start("gateway", ["radosgw", "--name", "client.rgw.a", "--foreground"])
    until("the gateway answers", lambda: http("/", S3)[0] == 200)


def serve(folder="data", environment=None, prefix=PREFIX, bucket=BUCKET, name="server"):
    command = [ROOST, "serve", "--listen", f"127.0.0.1:{PORT}", "--data", FOLDER / folder, "--objects", f"s3://{bucket}/{prefix}",
               "--checkpoint-interval", "3s"]
    return start(name, command, dict(KEYS, **(environment or {})))


def start_server(folder="data"):
    serve(folder)
    until("the server answers", lambda: http("/healthz")[0] == 200)


def start_worker(name):
    start(name, [ROOST, "work", "--server", SERVER, "--state", FOLDER / name, "--threads", "1", "--slots", "2",
                 "--name", name, "--backend", "cpu"])


def allow(actions):
    """What the server may do in the bucket, which belongs to somebody else."""
    where = [f"arn:aws:s3:::{BUCKET}", f"arn:aws:s3:::{BUCKET}/*"]
    statement = {"Effect": "Allow", "Principal": {"AWS": ["arn:aws:iam:::user/roost"]}, "Action": actions, "Resource": where}
    OWNER.put_bucket_policy(Bucket=BUCKET, Policy=json.dumps({"Version": "2012-10-17", "Statement": [statement]}))


def listed(is_upload=False):
    """The sizes of objects, or of the uploads without a name that a failure has left: the next start removes them."""
    pages = USER.get_paginator("list_objects_v2").paginate(Bucket=BUCKET)
    return {item["Key"]: item["Size"] for page in pages for item in page.get("Contents", []) if ("/uploads/" in item["Key"]) == is_upload}


def refused(what, expected, environment=None, **place):
    began = time.monotonic()
    process = serve("refused", environment, name="refused", **place)
    try:
        process.wait(120)
    except subprocess.TimeoutExpired:
        process.kill()
    message = (FOLDER / "refused.log").read_text().strip().splitlines()[-1:]
    (FOLDER / "refused.log").unlink()
    check(process.returncode not in (0, -9) and any(expected in line for line in message),
          f"{what}: exit {process.returncode} after {time.monotonic() - began:.1f} s: {' '.join(message)[:400]}")


def submit(document, *options):
    file = FOLDER / "document.json"
    file.write_text(json.dumps(document))
    return json.loads(roost("submit", "--json", *options, file).stdout)["id"]


def sweep(seed, replicates=3, **fields):
    """Three gates. Jobs share the fill of their seed, unless they record frames."""
    factors = [{"pointer": "/equipment/gate_opening_m", "levels": [0.05, 0.06, 0.08]}]
    return submit({"name": f"seeds from {seed}", "base": dict(HOPPER, seed=seed), "design": {"kind": "grid"}, "factors": factors,
                   "replicates": replicates, "cache": "bypass", **fields})


def counts(identifier):
    return get(f"/v1/sweeps/{identifier}")["counts"]


def jobs_of(identifier):
    return get(f"/v1/sweeps/{identifier}/jobs?limit=500")["items"]


def running(identifier):
    return lambda: counts(identifier)["running"] > 0 and counts(identifier)["succeeded"] > 0


def finish(identifier, what, frames=True):
    """All jobs of a sweep succeed, with frames; or with fills that they share."""
    until(f"{what}: the end", lambda: counts(identifier)["queued"] + counts(identifier)["running"] == 0)
    jobs = jobs_of(identifier)
    attempts = sum(job["attempt"] for job in jobs)
    succeeded = sum(job["state"] == "succeeded" for job in jobs)
    with_frames = [job for job in jobs if job.get("frames")]
    bytes_read = sum(len(http(f"/v1/jobs/{job['id']}/frames")[1]) for job in with_frames)
    total = sum(job["frames"]["bytes"] for job in with_frames)
    shared = sum(job.get("filled_by") == "shared" for job in jobs)
    more = f"{len(with_frames)} with frames, {bytes_read} bytes read" if frames else f"{shared} began from the fill of another job"
    check(succeeded == len(jobs) and bytes_read == total and len(with_frames) == (len(jobs) if frames else 0),
          f"{what}: {succeeded} of {len(jobs)} jobs succeeded in {attempts} attempts, {more}")
    return jobs


def same_bits(job):
    """Whether a run without disturbance has the same responses, series and curves."""
    result = get(f"/v1/jobs/{job['id']}/result")
    scenario = FOLDER / "again.json"
    scenario.write_text(json.dumps(result["scenario"]))
    subprocess.run([ROOST, "run", scenario, "-o", FOLDER / "again", "--threads", "1", "--no-shared-fill"], check=True, capture_output=True)
    again = json.loads((FOLDER / "again/result.json").read_text())
    return all(again[part] == result[part] for part in ["responses", "series", "curves", "end_reason"])


def named(folder="data"):
    """The objects that the database names, by table."""
    database = sqlite3.connect(f"file:{FOLDER}/{folder}/roost.db?mode=ro", uri=True)
    tables = ["frames", "checkpoints", "fills"]
    return {table: {row[0] for row in database.execute(f"SELECT object_digest FROM {table} WHERE object_digest IS NOT NULL")}
            for table in tables}


def audit(what):
    """Every named object is in the bucket, with the bytes of its digest; nothing else is."""
    time.sleep(3)  # checkpoints of ended jobs are removed every second
    names, objects = named(), listed()
    of_digest = {key.rsplit("/", 1)[1]: key for key in objects}
    wanted = set().union(*names.values())
    wrong = 0
    for digest in wanted & of_digest.keys():
        body = USER.get_object(Bucket=BUCKET, Key=of_digest[digest])["Body"].read()
        wrong += blake3.blake3(body).hexdigest() != digest
    unnamed = of_digest.keys() - wanted
    check(wanted <= of_digest.keys() and wrong == 0,
          f"{what}: {len(wanted)} objects named ({', '.join(f'{len(some)} {table}' for table, some in names.items())}), "
          f"{len(wanted - of_digest.keys())} missing, {wrong} with other bytes, {len(unnamed)} unnamed in the bucket, "
          f"{sum(objects.values())} bytes; {len(listed(is_upload=True))} uploads without a name")
    return unnamed


def stl():
    lines = ["solid hopper"]
    for corner, first, second in PLATES["hopper"]:
        add = lambda *vectors: tuple(map(sum, zip(*vectors)))
        corners = [corner, add(corner, first), add(corner, first, second), add(corner, second)]
        for triangle in [corners[:3], [corners[0], corners[2], corners[3]]]:
            points = "\n".join(f"vertex {x} {y} {z}" for x, y, z in triangle)
            lines.append(f"facet normal 0 0 0\nouter loop\n{points}\nendloop\nendfacet")
    (FOLDER / "hopper.stl").write_text("\n".join([*lines, "endsolid hopper"]))


def mesh_sweep():
    stl()
    surfaces = [{"name": "hopper", "mesh": {"file": "hopper.stl", "units": "m"}},
                {"name": "belt", "plate_m": [[-0.4, -0.3, 0], [1.4, 0, 0], [0, 0.6, 0]], "kind": "belt", "motion": "belt",
                 "velocity_m_s": [0.25, 0, 0]},
                {"name": "shutter", "plate_m": [[0, -0.1, 0], [0, 0.2, 0], [0, 0, 0.06]], "presence": "until_start"}]
    equipment = {"parametric": False, "opening_width_m": 0.2, "opening_height_m": 0.06, "hopper_length_m": 0.3, "hopper_width_m": 0.2,
                 "hopper_height_m": 0.5, "surfaces": surfaces}
    return submit({"name": "mesh", "base": dict(HOPPER, equipment=equipment), "design": {"kind": "grid"}, "factors": [], "replicates": 3,
                   "cache": "bypass", "frame_interval_s": 0.02})


def post(path, document, method="POST", media_type="application/json"):
    body = document if isinstance(document, bytes) else json.dumps(document).encode()
    request = urllib.request.Request(SERVER + path, data=body, method=method, headers={"content-type": media_type})
    with urllib.request.urlopen(request, timeout=300) as answer:
        return json.load(answer)


def large_stream():
    """Plays a worker that delivers frames of three parts, and reads them back."""
    worker, began = str(uuid.uuid4()), time.monotonic()
    revision = get("/v1/version")["solver_revision"]
    post("/v1/workers", {"worker_id": worker, "name": "played", "api_version": "v1", "solver_revision": revision, "backend": "cpu",
                         "device": "none", "threads": 1})
    file = FOLDER / "large.json"
    file.write_text(json.dumps(HOPPER))
    job = json.loads(roost("submit", "--json", "--no-cache", "--frame-interval", "0.02", file).stdout)["id"]
    claim = {"request_id": str(uuid.uuid4()), "worker_id": worker, "max_jobs": 1, "wait_s": 20}
    number = post("/v1/claims", claim)["attempts"][0]["attempt"]
    stream = MAGIC + os.urandom(20_000_003)
    post(f"/v1/jobs/{job}/attempts/{number}/frames?worker_id={worker}&count=1", stream, "PUT", "application/octet-stream")
    whole = http(f"/v1/jobs/{job}/frames")[1]
    request = urllib.request.Request(f"{SERVER}/v1/jobs/{job}/frames", headers={"range": "bytes=8388600-8388620"})
    with urllib.request.urlopen(request, timeout=60) as answer:
        part = answer.read()
    check(whole == stream and part == stream[8388600:8388621],
          f"a stream of {len(stream)} bytes came back unchanged, whole and by range, in {time.monotonic() - began:.1f} s")
    roost("cancel", job)


def outage(seed, what, begin, end):
    """Disturbs the bucket while jobs run; a client asks for frames meanwhile."""
    before = next(job for job in jobs_of(FIRST) if job.get("frames"))
    identifier, filling = sweep(seed, frame_interval_s=0.02), sweep(seed + 50, shared_fill=True)
    until(f"{what}: jobs run", running(identifier))
    begin()
    began = time.monotonic()
    status, body, seconds = http(f"/v1/jobs/{before['id']}/frames")
    detail = json.loads(body).get("detail") if status not in (0, 200) else f"{len(body)} bytes"
    print(f"  {what}: a client that asks for frames gets {status} after {seconds:.1f} s: {detail}")
    alive = http("/healthz")[0] == 200
    time.sleep(max(0, OUTAGE_S - (time.monotonic() - began)))
    end()
    check(alive and http("/healthz")[0] == 200, f"{what}: the server answered during and after {time.monotonic() - began:.0f} s")
    finish(identifier, what)
    finish(filling, what, frames=False)


def main():
    global FIRST
    start_gateway()
    print("the server refuses to start:")
    # Too early for a bucket: it does not exist yet.
    refused("the bucket is missing", f"s3://{BUCKET}/{PREFIX}")
    OWNER.create_bucket(Bucket=BUCKET)
    refused("the bucket belongs to somebody else", f"s3://{BUCKET}/{PREFIX}")
    allow(["s3:GetObject", "s3:ListBucket"])
    refused("the bucket is read-only", f"s3://{BUCKET}/{PREFIX}")
    allow(ALL)
    refused("the secret is wrong", f"s3://{BUCKET}/{PREFIX}", {"AWS_SECRET_ACCESS_KEY": "wrong"})
    refused("nothing answers at the endpoint", f"s3://{BUCKET}/{PREFIX}", {"AWS_ENDPOINT_URL": "http://127.0.0.1:9"})

    print("jobs:")
    start_server()
    large_stream()
    if os.environ.get("ONLY_LARGE"):
        return
    start_worker("first")
    FIRST = sweep(100, replicates=4, frame_interval_s=0.02)
    until("jobs run", running(FIRST))
    stop("server", signal.SIGKILL)
    time.sleep(2)
    start_server()
    first = finish(FIRST, "kill -9 of the server")
    finish(mesh_sweep(), "a hopper from a mesh")
    filled = finish(sweep(150, shared_fill=True), "jobs with the same fills", frames=False)
    check(any(job.get("filled_by") == "shared" for job in filled), "fills are shared")

    long = json.loads(json.dumps(HOPPER))
    long["equipment"]["belt_speed_m_s"], long["numerics"]["duration_s"], long["numerics"]["timestep_s"] = 0.005, 8, 2e-5
    job = submit(long, "--no-cache")
    until("a checkpoint is stored", lambda: named()["checkpoints"])
    stop("first", signal.SIGKILL)
    start_worker("second")
    until("the long job ends", lambda: get(f"/v1/jobs/{job}")["state"] not in ("queued", "running"))
    database = sqlite3.connect(f"file:{FOLDER}/data/roost.db?mode=ro", uri=True)
    attempts = database.execute("SELECT number, outcome, resumed_from_s FROM attempts WHERE job_id = ? ORDER BY number", [job]).fetchall()
    check(get(f"/v1/jobs/{job}")["state"] == "succeeded" and attempts[-1][2] is not None,
          f"kill -9 of the worker: attempts (number, outcome, continued from s) {attempts}")
    check(same_bits(get(f"/v1/jobs/{job}")), "the result has the bits of a run without a kill")

    outage(200, "gateway stopped", lambda: stop("gateway"), start_gateway)
    gateway = started["gateway"]
    outage(300, "gateway frozen", lambda: gateway.send_signal(signal.SIGSTOP), lambda: gateway.send_signal(signal.SIGCONT))
    outage(400, "bucket read-only", lambda: allow(["s3:GetObject", "s3:ListBucket"]), lambda: allow(ALL))
    check(all(same_bits(job) for job in [first[0], filled[-1]]), "two results have the bits of runs without a server")
    unnamed = audit("audit")

    print("backup and deletion:")
    copied = roost("backup", FOLDER / "backup", "--data", FOLDER / "data")
    print("  " + " ".join((copied.stdout + copied.stderr).split()))
    stop("second")
    stop("server")
    started_with = listed()
    roost("restore", FOLDER / "backup", "--data", FOLDER / "restored")
    start_server("restored")
    read = [http(f"/v1/jobs/{job['id']}/frames") for job in first]
    check(all(status == 200 for status, _, _ in read) and listed() == started_with and not listed(is_upload=True),
          f"a restored server reads the frames of {len(read)} jobs from the same bucket; it deletes the uploads without a name and nothing else")
    stop("server")
    start_server()
    names = named()
    roost("delete", FIRST, "--yes")
    until("the sweep is gone", lambda: http(f"/v1/sweeps/{FIRST}")[0] == 404)
    left = {key.rsplit("/", 1)[1] for key in listed()}
    gone = names["frames"] - named()["frames"]
    check(gone and not gone & left, f"deletion of a sweep removed its {len(gone)} objects from the bucket")
    request = urllib.request.Request(f"{SERVER}/v1/prune?older_than_s=0", method="POST")
    with urllib.request.urlopen(request, timeout=120) as answer:
        pruned = json.load(answer)
    print(f"  pruned: {len(pruned['sweeps'])} sweeps, {pruned['jobs']} single jobs, {len(pruned['meshes'])} meshes")
    left = {key.rsplit("/", 1)[1] for key in listed()}
    check(not named()["frames"] and not left - named()["fills"] - unnamed,
          f"pruning left {len(left)} objects: {len(named()['fills'])} fills, {len(left - named()['fills'])} unnamed ones for the daily sweep")
    parts = OWNER.list_multipart_uploads(Bucket=BUCKET).get("Uploads", [])
    print(f"  remains of interrupted uploads: {len(parts)}")
    errors = sum(" ERROR " in line for line in (FOLDER / "server.log").read_text().splitlines())
    print(f"  lines with ERROR in the server's log: {errors}")


def client(user):
    return boto3.client("s3", endpoint_url=S3, region_name="us-east-1", aws_access_key_id=f"{user}-key",
                        aws_secret_access_key=f"{user}-secret")


# The first owns the bucket, and the second its objects.
OWNER, USER = client("owner"), client("roost")
signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
try:
    main()
finally:
    for process in started.values():
        process.send_signal(signal.SIGCONT)
        process.kill()
        process.wait()
print(f"faults: {len(faults)}")
sys.exit(bool(faults))
