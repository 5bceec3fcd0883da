"""Starts the containers of deploy/kubernetes without a cluster: in an empty read-only root, as their user, without capabilities.

    cargo build
    sudo unshare --mount --net target/kubernetes/venv/bin/python tests/kubernetes/pods.py target/debug/roost

`check.sh` makes the virtual environment. Volumes are folders; the network is a loopback of its own, so port 7373 is free. Takes a minute:
a worker drains for 30 s. Not the same as on a cluster: no seccomp profile, no limits, one network for all pods.
"""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

import yaml

ROOST = Path(sys.argv[1]).resolve()
MANIFESTS = Path(__file__).resolve().parents[2] / "deploy/kubernetes"
CERTIFICATES = "etc/ssl/certs/ca-certificates.crt"
TOOLS = ["sh", "cat", "mkdir", "mv", "rm", "sleep", "tar", "touch", "setpriv"]
SERVER = "http://127.0.0.1:7373"
# All processes of containers.
STARTED = []
# Mounts the root and the volumes, makes the root read-only, and runs the rest of the arguments in it as the user of the pod.
ENTER = """set -eu
root=$1 uid=$2 gid=$3 group=$4 folder=$5; shift 5
mount --rbind "$root" "$root"
mount -t proc proc "$root/proc"
mount --bind /dev/null "$root/dev/null"
while [ "$1" != -- ]; do mount --bind "$1" "$root$2"; [ "$3" = rw ] || mount -o remount,bind,ro "$root$2"; shift 3; done
shift
mount -o remount,bind,ro "$root"
exec chroot "$root" /bin/setpriv --reuid "$uid" --regid "$gid" --groups "$group" --no-new-privs \\
    --bounding-set -all --inh-caps -all --ambient-caps -all /bin/sh -c 'cd "$0" && exec "$@"' "$folder" "$@"
"""


def pod_of(name, kind):
    """The specification of the pod of a manifest."""
    documents = yaml.safe_load_all((MANIFESTS / name).read_text(encoding="utf-8"))
    spec = next(document["spec"] for document in documents if document["kind"] == kind)
    return spec["template"]["spec"] if "template" in spec else spec


def libraries(program):
    listed = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    return [word for word in listed.split() if word.startswith("/")]


class Pod:
    """A pod: its containers share volumes, folders of this machine.

    `variables` are those that the manifests take from elsewhere, such as secrets. They also replace `$(NAME)` in arguments.
    """

    def __init__(self, here, spec, volumes, variables=None, hosts="127.0.0.1 localhost roost\n"):
        self.spec, self.volumes, self.here, self.variables = spec, volumes, here, variables or {}
        self.root = Path(tempfile.mkdtemp(dir=here, prefix="root-"))
        self.root.chmod(0o755)
        mounts = [mount["mountPath"][1:] for container in self.containers() for mount in container["volumeMounts"]]
        for folder in ["bin", "dev", "etc", "proc", "tmp", "usr/local/bin", "var/lib/roost", *mounts]:
            (self.root / folder).mkdir(parents=True, exist_ok=True)
        for program in [shutil.which(tool) for tool in TOOLS] + [ROOST]:
            self.add(program, "usr/local/bin/roost" if program == ROOST else f"bin/{Path(program).name}")
        (self.root / "dev/null").touch()
        (self.root / "etc/hosts").write_text(hosts)
        # The image has Debian's package ca-certificates; clients of a bucket need them.
        (self.root / CERTIFICATES).parent.mkdir(parents=True)
        shutil.copy(Path("/") / CERTIFICATES, self.root / CERTIFICATES)

    def containers(self):
        return self.spec.get("initContainers", []) + self.spec["containers"]

    def add(self, program, inside):
        """Copies a program or a library with its libraries into the root."""
        (self.root / inside).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(program, self.root / inside)
        for library in libraries(program):
            (self.root / library[1:]).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(library, self.root / library[1:])

    def expand(self, word):
        for name, value in self.variables.items():
            word = word.replace(f"$({name})", value)
        return word

    def start(self, container, command=None, **pipes):
        """Starts a container, or a command in it as `kubectl exec` does."""
        user, confined = self.spec["securityContext"], container["securityContext"]
        assert user["runAsNonRoot"] and confined["readOnlyRootFilesystem"] and confined["capabilities"]["drop"] == ["ALL"]
        arguments = [self.root, user["runAsUser"], user["runAsGroup"], user["fsGroup"], container.get("workingDir", "/var/lib/roost")]
        for mount in container["volumeMounts"]:
            arguments += [self.volumes[mount["name"]], mount["mountPath"], "ro" if mount.get("readOnly") else "rw"]
        own = container.get("command", ["/usr/local/bin/roost"]) + container.get("args", [])
        arguments += ["--", *map(self.expand, command or own)]
        variables = {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"}
        variables.update((entry["name"], entry["value"]) for entry in container.get("env", []) if "value" in entry)
        variables.update(self.variables)
        script = ["unshare", "--mount", "/bin/sh", "-c", ENTER, "sh", *map(str, arguments)]
        process = subprocess.Popen(script, env=variables, **pipes)
        STARTED.append(process)
        return process

    def run(self, container, command=None, stdin=None):
        """Runs a container or a command to its end. Returns status and stdout."""
        process = self.start(container, command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        out, _ = process.communicate(stdin, timeout=60)
        return process.returncode, out


def status(path, token=None, server=SERVER):
    request = urllib.request.Request(server + path, headers={"authorization": f"Bearer {token}"} if token else {})
    try:
        with urllib.request.urlopen(request, timeout=5) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code
    except OSError:
        return 0


def until(what, poll, seconds=60):
    end = time.monotonic() + seconds
    while not poll():
        assert time.monotonic() < end, f"timeout: {what}"
        time.sleep(0.1)


@contextlib.contextmanager
def running(process):
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.wait(60)


def expect(text, found, wanted):
    print(f"{'ok' if found == wanted else 'FAILED'}: {text}: {found}", flush=True)
    assert found == wanted, wanted


def client(token, *arguments, server=SERVER):
    """The output of a client command, as JSON."""
    command = [ROOST, *arguments, "--json", "--server", server]
    output = subprocess.run(command, env={"ROOST_TOKEN": token}, capture_output=True, text=True, check=True)
    return json.loads(output.stdout)


def scenario(count, duration_s):
    """A hopper on whose slow belt the fillets stay."""
    numerics = {"timestep_s": 2e-5, "duration_s": duration_s, "stop": {"when_empty": False}}
    equipment = {"hopper_width_m": 0.2, "side_walls": "frictionless", "belt_speed_m_s": 0.005}
    product = {"count": count, "subparticle_radius_m": 0.009}
    return {"experiment": "hopper", "product": product, "equipment": equipment, "numerics": numerics}


def volume(here, name, group=10001):
    """A volume as Kubernetes mounts it: of root and the group of the pod."""
    folder = here / name
    folder.mkdir()
    os.chown(folder, 0, group)
    folder.chmod(0o2775)
    return folder


def main(here):
    data = volume(here, "data")
    server = Pod(here, pod_of("server.yaml", "StatefulSet"), {"data": data})
    first_tokens, serve = server.spec["initContainers"][0], server.spec["containers"][0]
    token = lambda name: (data / "tokens" / name).read_text().strip()

    expect("a server without tokens exits", server.run(serve)[0], 2)
    expect("the first container makes tokens", server.run(first_tokens)[0], 0)
    expect("their files are private", {oct((data / "tokens" / name).stat().st_mode)[-3:] for name in ["admin", "worker"]}, {"600"})
    admin = token("admin")
    expect("once", (server.run(first_tokens)[0], token("admin") == admin), (0, True))
    (data / "tokens").rename(here / "taken")
    expect("none once an operator has removed them", (server.run(first_tokens)[0], (data / "tokens").exists()), (0, False))
    (here / "taken").rename(data / "tokens")

    # A worker that drains.
    state, secret = volume(here, "state"), volume(here, "secret")
    (secret / "token").write_text(token("worker"))
    worker = Pod(here, pod_of("workers/workers.yaml", "Deployment"), {"state": state, "token": secret})
    with running(server.start(serve)), running(worker.start(worker.spec["containers"][0])) as work:
        until("the server is ready", lambda: status("/readyz") == 200)
        probes = [serve[probe]["httpGet"]["path"] for probe in ("startupProbe", "livenessProbe", "readinessProbe")]
        expect("its probes", [status(path) for path in probes], [200, 200, 200])
        known = [None, admin, token("worker")]
        expect("without, with the admin's and the worker's token", [status("/v1/sweeps", one) for one in known], [401, 200, 403])
        expect("a write beside the volume exits", server.run(serve, ["touch", "/tmp/file"])[0], 1)
        until("the worker is connected", lambda: client(admin, "list", "--workers")["items"])
        for name, document in {"short": scenario(2, 0.2), "long": scenario(8, 600)}.items():
            (here / f"{name}.json").write_text(json.dumps(document))
            client(admin, "submit", here / f"{name}.json")
        states = lambda: sorted(job["state"] for job in client(admin, "list", "--jobs")["items"])
        until("one job has ended", lambda: states() == ["running", "succeeded"])
        signalled = time.monotonic()
        work.send_signal(signal.SIGTERM)
        expect("a worker that gets SIGTERM exits", work.wait(60), 0)
        print(f"ok: after {time.monotonic() - signalled:.1f} s of {worker.spec['terminationGracePeriodSeconds']} s")
        expect("it has handed back the long job", states(), ["queued", "succeeded"])
        backup = ["roost", "backup", "backup", "--data", "data"]
        expect("a backup of the running server", server.run(serve, backup)[0], 0)
        archive = server.run(serve, ["tar", "c", "backup"])[1]
        expect("its copy is removed", server.run(serve, ["rm", "-r", "backup"])[0], 0)

    # The commands of docs/howto/operate.md.
    shell = Pod(here, pod_of("maintenance.yaml", "Pod"), {"data": data})
    container = shell.spec["containers"][0]
    for command in [["tar", "x"], ["mv", "data", "data.before"], ["roost", "restore", "backup", "--data", "data"]]:
        expect(" ".join(command), shell.run(container, command, archive if command[0] == "tar" else None)[0], 0)
    expect("the first container on the restored data", server.run(first_tokens)[0], 0)
    with running(server.start(serve)):
        until("the restored server is ready", lambda: status("/readyz") == 200)
        expect("it knows the token and the jobs", (status("/v1/sweeps", admin), states()), (200, ["queued", "succeeded"]))
        for one in json.loads(server.run(serve, ["roost", "token", "list", "--data", "data", "--json"])[1]):
            server.run(serve, ["roost", "token", "revoke", one["id"], "--data", "data"])
    expect("a server whose tokens are all revoked exits", server.run(serve)[0], 2)
    expect("the first container makes new tokens", (server.run(first_tokens)[0], token("admin") == admin), (0, False))


def start(main):
    """Runs a function with a folder in which it may mount, on a loopback of its own."""
    subprocess.run(["mount", "--make-rprivate", "/"], check=True)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        try:
            main(Path(folder))
        finally:
            for process in STARTED:
                process.kill()
                process.wait()
    print("all as expected")


if __name__ == "__main__":
    start(main)
