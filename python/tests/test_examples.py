"""The examples run as a user starts them, with few and small simulations."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from client.servers import Farm

EXAMPLES = Path(__file__).parents[1] / "examples"


def environment(**variables: str) -> dict[str, str]:
    """The environment with the commands of this build and of these tools."""
    folders = [str(Path(os.environ["ROOST_COMMAND"]).parent), str(Path(sys.executable).parent)]
    return {**os.environ, "PATH": os.pathsep.join([*folders, os.environ["PATH"]]), **variables}


def run(*command: str, cwd: Path, **variables: str) -> str:
    """Runs a command, and returns what it prints."""
    done = subprocess.run(command, cwd=cwd, env=environment(**variables), capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout + done.stderr


def test_snakemake_sweeps_gate_openings(tmp_path: Path) -> None:
    snakemake = shutil.which("snakemake", path=environment()["PATH"])
    if snakemake is None:
        pytest.fail("snakemake is missing: `make python-tools` installs it")
    folder = tmp_path / "snakemake"
    shutil.copytree(EXAMPLES / "snakemake", folder)
    base = json.loads((folder / "hopper.json").read_text())
    base["product"]["count"] = 2
    (folder / "hopper.json").write_text(json.dumps(base))
    sweep = [snakemake, "--cores", "2", "--config", "gates_mm=[45, 75]", "seeds=[1, 2]"]
    run(*sweep, cwd=folder)
    with (folder / "rates.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(float(row["gate_opening_m"]), row["n"]) for row in rows] == [(0.045, "2"), (0.075, "2")]
    assert all(float(row["mean_rate_kg_s"]) > 0 and float(row["half_width_95_kg_s"]) > 0 for row in rows)
    assert (folder / "rates.png").read_bytes().startswith(b"\x89PNG")
    # The number of a job is that of its file, and a second call has nothing to do.
    result = json.loads((folder / "results/75-2/result.json").read_text())
    assert (result["scenario"]["seed"], result["scenario"]["equipment"]["gate_opening_m"]) == (2, 0.075)
    assert "Nothing to be done" in run(*sweep, cwd=folder)


@pytest.fixture
def farm(tmp_path: Path) -> Iterator[Farm]:
    """A server with a worker."""
    with Farm(tmp_path) as farm:
        farm.serve()
        farm.work()
        yield farm


def test_optuna_chooses_points_that_jobs_evaluate(farm: Farm, tmp_path: Path) -> None:
    options = ["--rounds", "2", "--batch", "2", "--count", "3"]
    script = str(EXAMPLES / "optuna/steady_gate.py")
    shown = run(sys.executable, script, *options, cwd=tmp_path, ROOST_SERVER=farm.url, ROOST_TOKEN="")
    assert "after 4 jobs" in shown
    jobs = farm.client().jobs(label="optuna=steady gate")
    assert len(jobs) == 4 and all(job.state == "succeeded" for job in jobs)
    # The best point is that of one of the jobs.
    gates = [job.result().document["scenario"]["equipment"]["gate_opening_m"] for job in jobs]
    assert any(f"gate {gate:.4f} m" in shown for gate in gates)
