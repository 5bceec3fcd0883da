"""Starts the containers of deploy/kubernetes/postgres without a cluster, as pods.py does: PostgreSQL, two servers, and a worker.

    cargo build --features s3
    tests/s3/run.sh                # it makes the virtual environment of moto, which stands for the bucket
    sudo unshare --mount --net target/kubernetes/venv/bin/python tests/kubernetes/postgres_pods.py target/debug/roost

PostgreSQL is Debian's, in the user, the volumes and the variables of the manifest. Its first start follows the steps of the image's script
docker-entrypoint.sh. Each server has a loopback address of its own, since both listen on one port.
"""

import json
import os
import shutil
import signal
import subprocess
import time
import urllib.request
from pathlib import Path

from pods import Pod, client, expect, pod_of, running, scenario, start, status, until, volume

MOTO = Path(__file__).resolve().parents[2] / "target/s3/venv/bin/moto_server"
POSTGRES = max(Path("/usr/lib/postgresql").iterdir(), key=lambda folder: int(folder.name))
BUCKET = "http://127.0.0.1:5000"
ADDRESSES = {"roost-serve-0": "127.0.0.11", "roost-serve-1": "127.0.0.12", "roost-postgres": "127.0.0.13"}
HOSTS = f"""127.0.0.1 localhost
{ADDRESSES["roost-serve-1"]} roost
{ADDRESSES["roost-postgres"]} roost-postgres
{ADDRESSES["roost-serve-0"]} roost-serve-0.roost-servers
{ADDRESSES["roost-serve-1"]} roost-serve-1.roost-servers
"""
# The steps of docker-entrypoint.sh in the image, for a user that is not root.
ENTRYPOINT = """set -eu
mkdir -p "$PGDATA"; chmod 700 "$PGDATA"
mkdir -p /var/run/postgresql; chmod 3775 /var/run/postgresql || :
if ! [ -s "$PGDATA/PG_VERSION" ]; then
    initdb --username="$POSTGRES_USER" --pwfile="$POSTGRES_PASSWORD_FILE" $POSTGRES_INITDB_ARGS >/tmp/initdb.log
    echo "host all all all scram-sha-256" >> "$PGDATA/pg_hba.conf"
    pg_ctl -D "$PGDATA" -o "-c listen_addresses=" -w start >/tmp/start.log
    createdb --username="$POSTGRES_USER" "$POSTGRES_DB"
    pg_ctl -D "$PGDATA" -m fast -w stop >/tmp/stop.log
fi
exec postgres -c "listen_addresses=$ADDRESS"
"""


class Database(Pod):
    """The pod of PostgreSQL."""

    def __init__(self, here, password):
        volumes = {name: volume(here, f"postgres-{name}", 999) for name in ["data", "socket", "temporary", "shared-memory", "password"]}
        (volumes["password"] / "password").write_text(password)
        super().__init__(here, pod_of("postgres/database.yaml", "StatefulSet"), volumes, hosts=HOSTS)
        self.variables = {"ADDRESS": "127.0.0.1,127.0.0.13", "LC_ALL": "C", "PATH": f"{POSTGRES}/bin:/usr/sbin:/usr/bin:/sbin:/bin"}
        for program in (POSTGRES / "bin").iterdir():
            self.add(program, str(program)[1:])
        for tool in ["bash", "chmod"]:
            self.add(shutil.which(tool), f"bin/{tool}")
        for folder in [POSTGRES / "lib", Path(f"/usr/share/postgresql/{POSTGRES.name}"), Path("/usr/share/zoneinfo")]:
            shutil.copytree(folder, self.root / str(folder)[1:], dirs_exist_ok=True)
        for library in (POSTGRES / "lib").glob("*.so"):
            self.add(library, str(library)[1:])
        (self.root / "etc/passwd").write_text("postgres:x:999:999::/var/lib/postgresql:/bin/bash\n")
        for device in ["urandom", "zero"]:
            shutil.copy(os.devnull, self.root / f"dev/{device}")
        self.container = self.spec["containers"][0]

    def serve(self):
        process = self.start(self.container, ["/bin/bash", "-c", ENTRYPOINT])
        probe = self.container["readinessProbe"]["exec"]["command"]
        until("PostgreSQL is ready", lambda: self.run(self.container, probe)[0] == 0)
        return process

    def sql(self, statement):
        return self.run(self.container, ["psql", "--username=roost", "--tuples-only", "--no-align", "--command", statement])[1].decode().strip()


class Server(Pod):
    """The pod of a server."""

    def __init__(self, here, name, secrets, token):
        self.data = volume(here, name)
        super().__init__(here, pod_of("postgres/servers.yaml", "StatefulSet"), {"data": self.data, "token": token}, {**secrets, "POD_NAME": name}, HOSTS)
        self.first, self.container = self.spec["initContainers"][0], self.spec["containers"][0]
        # Both pods are in one network. A server that listens on loopback needs no token, so that its refusal needs the real address.
        self.original = ["roost", *self.container["args"]]
        self.container["args"] = [word.replace("0.0.0.0", ADDRESSES[name]) for word in self.container["args"]]
        self.url = f"http://{ADDRESSES[name]}:7373"

    def serve(self):
        process = self.start(self.container)
        until("the server is ready", lambda: status("/readyz", server=self.url) == 200)
        return process


def objects():
    with urllib.request.urlopen(f"{BUCKET}/roost-test?list-type=2", timeout=5) as answer:
        return answer.read().decode().count("<Key>farm/")


def main(here):
    password = "a password of this test"
    secrets = {"PGPASSWORD": password, "BUCKET": "s3://roost-test/farm", "AWS_ENDPOINT_URL": BUCKET, "AWS_ALLOW_HTTP": "true"}
    secrets |= {"AWS_REGION": "us-east-1", "AWS_ACCESS_KEY_ID": "key", "AWS_SECRET_ACCESS_KEY": "secret"}
    moto = subprocess.Popen([MOTO, "--host", "127.0.0.1", "--port", "5000"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until("moto answers", lambda: status("/", server=BUCKET) != 0)
    urllib.request.urlopen(urllib.request.Request(f"{BUCKET}/roost-test", method="PUT"), timeout=5).close()
    database, token = Database(here, password), volume(here, "token")
    one, two = [Server(here, name, secrets, token) for name in ["roost-serve-0", "roost-serve-1"]]

    with running(moto), running(database.serve()) as postgres:
        probes = [database.container[probe]["exec"]["command"] for probe in ("startupProbe", "livenessProbe", "readinessProbe")]
        expect("the probes of PostgreSQL", [database.run(database.container, probe)[0] for probe in probes], [0, 0, 0])
        expect("a write beside the volumes fails", database.run(database.container, ["touch", "/var/lib/file"])[0], 1)
        expect("the encoding and the roles", database.sql("SHOW server_encoding") + " " + database.sql("SELECT string_agg(rolname, ',') FROM pg_roles WHERE rolcanlogin"), "UTF8 roost")
        two.variables["PGPASSWORD"] = "wrong"
        expect("a server with a wrong password exits", two.run(two.container)[0], 1)
        two.variables["PGPASSWORD"] = password
        expect("a server without tokens exits", two.run(two.container, two.original)[0], 2)
        expect("the first container of the second pod makes no token", (two.run(two.first)[0], (two.data / "tokens").exists()), (0, False))
        expect("that of the first pod makes tokens", one.run(one.first)[0], 0)
        expect("their files are private", {oct((one.data / "tokens" / name).stat().st_mode)[-3:] for name in ["admin", "worker"]}, {"600"})
        admin, secret = [(one.data / "tokens" / name).read_text().strip() for name in ["admin", "worker"]]
        (token / "token").write_text(secret)

        first = one.serve()
        with running(two.serve()) as second:
            probes = [one.container[probe]["httpGet"]["path"] for probe in ("startupProbe", "livenessProbe", "readinessProbe")]
            expect("the probes of both servers", [status(path, server=pod.url) for pod in (one, two) for path in probes], [200] * 6)
            expect("the service of the standby, without and with a token", [status("/v1/sweeps", one_of, two.url) for one_of in (None, admin, secret)], [401, 200, 403])
            worker = Pod(here, pod_of("workers/workers.yaml", "Deployment"), {"state": volume(here, "state"), "token": token}, hosts=HOSTS)
            with running(worker.start(worker.spec["containers"][0])):
                (here / "job.json").write_text(json.dumps(scenario(2, 0.2)))
                client(admin, "submit", here / "job.json", "--frame-interval", "0.05", server=two.url)
                states = lambda pod: [job["state"] for job in client(admin, "list", "--jobs", server=pod.url)["items"]]
                until("the job has succeeded", lambda: states(two) == ["succeeded"])
                until("its frames are in the bucket", lambda: objects() > 0)
                asked = time.monotonic()
                first.send_signal(signal.SIGTERM)
                expect("the leader exits at SIGTERM", first.wait(60), 0)
                until("the second server leads", lambda: status("/v1/sweeps", admin, two.url) == 200)
                print(f"ok: the second server answers {time.monotonic() - asked:.1f} s after the signal")
                first = one.serve()
                expect("both know the job", [states(pod) for pod in (one, two)], [["succeeded"]] * 2)

                postgres.send_signal(signal.SIGINT)
                expect("PostgreSQL exits at the signal of its image", postgres.wait(120), 0)
                until("the servers are not ready", lambda: status("/readyz", server=one.url) == 503)
                expect("they are alive", [status("/healthz", server=pod.url) for pod in (one, two)], [200, 200])
                postgres = database.serve()
                until("both are ready", lambda: [status("/readyz", server=pod.url) for pod in (one, two)] == [200, 200])
                expect("both know the job", [states(pod) for pod in (one, two)], [["succeeded"]] * 2)
            # The commands of docs/howto/operate.md.
            dump = database.run(database.container, ["pg_dump", "--username=roost", "--format=custom", "roost"])[1]
            client(admin, "prune", "--older-than", "0h", "--yes", server=two.url)
            expect("the mistake", states(one), [])
            for process in (first, second):
                process.send_signal(signal.SIGTERM)
                process.wait(60)
        restore = ["pg_restore", "--username=roost", "--dbname=postgres", "--clean", "--create", "--if-exists", "--exit-on-error"]
        expect("the dump is restored", database.run(database.container, restore, dump)[0], 0)
        with running(one.serve()):
            expect("the restored server knows the job", states(one), ["succeeded"])
        postgres.send_signal(signal.SIGINT)
        postgres.wait(120)


if __name__ == "__main__":
    start(main)
