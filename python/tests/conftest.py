"""What the tests share: small scenarios, and the command `roost` that they are compared with."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import pytest

Fields: TypeAlias = Any
"""A document that tests change, also into a wrong one: no type of the package."""


def hopper(duration_s: float) -> Fields:
    """A few coarse fillets in a small hopper."""
    return {
        "experiment": "hopper",
        "product": {"count": 2, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "duration_s": duration_s, "stop": {"when_empty": False}},
    }


def slow_hopper(duration_s: float = 2.5) -> Fields:
    """The same with a slow belt and small steps: about a second of wall time."""
    fields = hopper(duration_s)
    fields["equipment"]["belt_speed_m_s"] = 0.005
    fields["numerics"]["timestep_s"] = 2e-5
    return fields


def physics(document: Fields) -> Fields:
    """A result document without its wall time."""
    performance = {k: v for k, v in document["performance"].items() if k not in ("wall_s", "ns_per_particle_step")}
    return {**document, "performance": performance}


@pytest.fixture(scope="session")
def command() -> str:
    """Path of the command `roost` of this build."""
    return os.environ["ROOST_COMMAND"]


@pytest.fixture
def roost_run(command: str, tmp_path: Path) -> Callable[..., Fields]:
    """Runs a scenario with `roost run`, and returns its result document."""

    def run(fields: Fields, *options: str, folder: Path = tmp_path / "out") -> Fields:
        file = tmp_path / "scenario.json"
        file.write_text(json.dumps(fields))
        arguments = [command, "run", str(file), "--output", str(folder), *(options or ("--backend", "cpu"))]
        done = subprocess.run(arguments, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        document: Fields = json.loads((folder / "result.json").read_text())
        return document

    return run
