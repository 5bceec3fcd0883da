"""A server and its workers on this machine, for the measurements of this folder."""
import json
import os
import pathlib
import subprocess
import time
import urllib.request


class Farm:
    """A server with fresh data and no worker. As a context it ends all its processes."""

    def __init__(self, roost, folder, *options):
        self.roost, self.folder = roost, folder
        port = 20000 + os.getpid() % 20000
        self.address = f"http://127.0.0.1:{port}"
        self.environment = {**os.environ, "ROOST_SERVER": self.address, "ROOST_LOG": "error"}
        self.server = self.start("serve", "--listen", f"127.0.0.1:{port}", "--data", f"{folder}/data", *options)
        self.workers = []
        time.sleep(1.5)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in [*self.workers, self.server]:
            process.terminate()
            process.wait()

    def start(self, *arguments):
        return subprocess.Popen([self.roost, *arguments], env=self.environment, stderr=subprocess.DEVNULL)

    def worker(self, name, *options):
        """Starts a worker whose state stays when it is started again."""
        return self.start("work", "--backend", "cpu", "--name", name, "--state", f"{self.folder}/{name}", *options)

    def get(self, path):
        with urllib.request.urlopen(self.address + path, timeout=30) as answer:
            return json.load(answer)

    def submit(self, sweep):
        """The id of the sweep."""
        document = pathlib.Path(self.folder, "sweep.json")
        document.write_text(json.dumps(sweep))
        done = subprocess.run([self.roost, "submit", "--json", document], env=self.environment, check=True,
                              stdout=subprocess.PIPE)
        return json.loads(done.stdout)["id"]

    def jobs(self, sweep):
        """All jobs of the sweep, in the order of its points."""
        items, path = [], f"/v1/sweeps/{sweep}/jobs?limit=100"
        while path:
            page = self.get(path)
            items += page["items"]
            cursor = page.get("next_cursor")
            path = cursor and f"/v1/sweeps/{sweep}/jobs?limit=100&cursor={cursor}"
        return items
