"""A server and its workers on this machine, for the measurements of this folder."""
import json
import os
import socket
import subprocess
import time
import urllib.request


class Farm:
    """A server with fresh data and no worker. As a context it ends all its processes."""

    def __init__(self, roost, folder, *options):
        self.roost, self.folder = roost, folder
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.listen = f"127.0.0.1:{free.getsockname()[1]}"
        self.address = f"http://{self.listen}"
        self.environment = {**os.environ, "ROOST_SERVER": self.address, "ROOST_LOG": "error"}
        self.options, self.workers = options, []
        self.start_server()

    def start_server(self):
        """Starts the server, again on the same address, and waits until it answers."""
        self.server = self.start("serve", "--listen", self.listen, "--data", f"{self.folder}/data", *self.options)
        for _ in range(300):
            try:
                socket.create_connection(("127.0.0.1", int(self.listen.split(":")[1]))).close()
                return
            except ConnectionRefusedError:
                time.sleep(0.1)
        raise SystemExit("the server does not start")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in [*self.workers, self.server]:
            process.terminate()
            process.wait()

    def start(self, *arguments):
        return subprocess.Popen([self.roost, *arguments], env=self.environment, stdout=subprocess.DEVNULL,
                                stderr=subprocess.DEVNULL)

    def worker(self, name, *options):
        """Starts a worker whose state stays when it is started again."""
        return self.start("work", "--backend", "cpu", "--name", name, "--state", f"{self.folder}/{name}", *options)

    def get(self, path):
        with urllib.request.urlopen(self.address + path, timeout=30) as answer:
            return json.load(answer)

    def submit(self, document, kind="sweeps"):
        """The id of a submitted sweep, or of a study."""
        request = urllib.request.Request(f"{self.address}/v1/{kind}", json.dumps(document).encode(),
                                         {"content-type": "application/json"})
        with urllib.request.urlopen(request, timeout=30) as answer:
            return json.load(answer)["id"]

    def wait(self, sweep):
        """Waits until all jobs of the sweep have ended."""
        while True:
            counts = self.get(f"/v1/sweeps/{sweep}")["counts"]
            if counts["queued"] + counts["running"] == 0:
                return
            time.sleep(0.2)

    def jobs(self, sweep):
        """All jobs of the sweep, in the order of its points."""
        items, path = [], f"/v1/sweeps/{sweep}/jobs?limit=100"
        while path:
            page = self.get(path)
            items += page["items"]
            cursor = page.get("next_cursor")
            path = cursor and f"/v1/sweeps/{sweep}/jobs?limit=100&cursor={cursor}"
        return items

    def trials(self, sweep):
        """The result table of the sweep."""
        return self.get(f"/v1/sweeps/{sweep}/results")["trials"]
