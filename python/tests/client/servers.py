"""Real servers and workers for the tests of the client: the `roost` binary of ROOST_COMMAND, on free ports of this machine."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any, TypeAlias

from roost.client import Client

Document: TypeAlias = Any
"""A document that tests change, also into a wrong one: no type of the package."""

ROOT = Path(__file__).resolve().parents[3]
ROOST = os.environ.get("ROOST_COMMAND", str(ROOT / "target/debug/roost"))


class Farm:
    """A server at a fixed address with its data in a folder, and its workers. As a context, it ends them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: list[subprocess.Popen[bytes]] = []
        # The system chooses the port at the first start; later servers keep it.
        self.url = "http://127.0.0.1:0"

    def __enter__(self) -> Farm:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def serve(self, *arguments: str) -> subprocess.Popen[bytes]:
        """Starts the server, and waits until it listens."""
        command = [
            "serve",
            "--listen",
            self.url.removeprefix("http://"),
            "--heartbeat-s",
            "0.2",
            "--data",
            str(self.folder / "data"),
        ]
        server = self._start([*command, *arguments], stdout=subprocess.PIPE)
        assert server.stdout is not None
        line = server.stdout.readline().decode()
        assert line.startswith("listening on "), line
        self.url = line.split()[-1]
        return server

    def work(self) -> subprocess.Popen[bytes]:
        """Starts a worker."""
        return self._start(
            ["work", "--server", self.url, "--threads", "2", "--slots", "2", "--state", str(self.folder / "worker")]
        )

    def client(self, **options: Any) -> Client:
        """A client of the server."""
        return Client(self.url, "", **options)

    def stop(self) -> None:
        """Ends all processes."""
        for process in self.processes:
            process.kill()
            process.wait()
            if process.stdout:
                process.stdout.close()

    def _start(self, arguments: list[str], stdout: int = subprocess.DEVNULL) -> subprocess.Popen[bytes]:
        variables = {name: value for name, value in os.environ.items() if not name.startswith("ROOST_")}
        with (self.folder / "log").open("ab") as log:
            variables["ROOST_FILLS"] = ""
            process: subprocess.Popen[bytes] = subprocess.Popen(
                [ROOST, *arguments], stdin=subprocess.DEVNULL, stdout=stdout, stderr=log, env=variables
            )
        self.processes.append(process)
        return process


def hopper(duration_s: float = 0.5, **fields: Any) -> Document:
    """A scenario of two coarse fillets in a small hopper, which takes a fraction of a second."""
    return {
        "experiment": "hopper",
        "product": {"count": 2, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "duration_s": duration_s, "stop": {"when_empty": False}},
        **fields,
    }


def slow_hopper() -> Document:
    """A scenario that takes minutes."""
    scenario = hopper(500.0)
    scenario["equipment"]["belt_speed_m_s"] = 0.005
    scenario["numerics"]["timestep_s"] = 2e-5
    return scenario
