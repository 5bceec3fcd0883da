"""Ctrl-C and checkpoints: package and command continue each other's files."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import roost
from conftest import Fields, hopper, physics, slow_hopper

SCRIPT = """
import json, sys, time
import roost

def show(progress):
    if progress.fraction > 0.3:
        print("under way", flush=True)
        time.sleep(60)  # until SIGINT

try:
    roost.run(json.loads(sys.argv[1]), threads=1, checkpoint=sys.argv[2], progress=show)
except roost.Interrupted as stop:
    series = stop.result.series["discharged_mass"]
    print(json.dumps([stop.result.end_reason, len(series.x), stop.result.responses]))
    raise SystemExit(3)
"""


# Long enough to be interrupted on a fast machine.
LONG = slow_hopper(5.0)


@pytest.fixture(scope="module")
def undisturbed() -> Fields:
    return physics(roost.run(LONG, threads=1, progress=False).document)


def start(arguments: list[str], folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder)


def interrupt(process: subprocess.Popen[str]) -> str:
    """Sends SIGINT. Returns what the process printed."""
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60)
    assert process.returncode in (1, 3), errors
    return output


def test_the_command_continues_after_ctrl_c_in_python(
    undisturbed: Fields, roost_run: Callable[..., Fields], tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    arguments = [sys.executable, "-c", SCRIPT, json.dumps(LONG), str(folder)]
    with start(arguments, tmp_path) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "under way\n"
        output = interrupt(process)
    assert process.returncode == 3
    end_reason, samples, responses = json.loads(output.splitlines()[-1])
    assert (end_reason, responses) == ("cancelled", {}) and samples > 1
    assert (folder / "checkpoint.roost").exists()
    options = ("--backend", "cpu", "--threads", "1", "--checkpoint-every", "1h")
    assert physics(roost_run(LONG, *options, folder=folder)) == undisturbed
    assert not (folder / "checkpoint.roost").exists()


def interrupted(command: str, file: Path, folder: Path) -> Path | None:
    """The checkpoint of a run that a signal has stopped; none if the signal came before the first step, or after the last."""
    saved = folder / "checkpoint.roost"
    arguments = [command, "run", str(file), "-o", str(folder), "--backend", "cpu", "--threads", "1"]
    # Only the signal saves.
    with start([*arguments, "--checkpoint-every", "1h"], file.parent) as process:
        assert process.stderr is not None
        while "sub-particles, at most" not in process.stderr.readline():
            assert process.poll() is None
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    return saved if saved.exists() and process.returncode != 0 else None


def test_python_continues_after_ctrl_c_in_the_command(undisturbed: Fields, command: str, tmp_path: Path) -> None:
    file = tmp_path / "scenario.json"
    file.write_text(json.dumps(LONG))
    # A busy machine may miss the run.
    saved = next(filter(None, (interrupted(command, file, tmp_path / f"out {attempt}") for attempt in range(5))))
    seen: list[roost.Progress] = []
    result = roost.run(file, threads=1, checkpoint=saved, progress=seen.append)
    assert physics(result.document) == undisturbed
    # A run from the beginning reports after 0.1 s.
    assert seen[0].wall_s > 0.3 and not saved.exists()


def test_a_checkpoint_of_another_run_is_refused(tmp_path: Path) -> None:
    saved = tmp_path / "new" / "run.roost"
    endless = slow_hopper(500.0)
    first: list[roost.Progress] = []
    second: list[roost.Progress] = []

    def stop_late(progress: roost.Progress) -> None:
        first.append(progress)
        if len(first) == 10:
            raise StopIteration

    def stop_at_once(progress: roost.Progress) -> None:
        second.append(progress)
        raise StopIteration

    with pytest.raises(StopIteration):
        roost.run(endless, threads=1, checkpoint=saved, progress=stop_late)
    with pytest.raises(roost.RoostError, match="another scenario.*from_start=True begins at zero"):
        roost.run(endless, threads=1, seed=7, checkpoint=saved, progress=False)
    with pytest.raises(StopIteration):
        roost.run(endless, threads=1, seed=7, checkpoint=saved, from_start=True, progress=stop_at_once)
    assert second[0].fraction < first[-1].fraction
    saved.write_bytes(b"no checkpoint")
    with pytest.raises(roost.RoostError, match="this is not a checkpoint of Roost"):
        roost.run(endless, threads=1, checkpoint=saved, progress=False)


def test_checkpoints_are_written_during_a_run(tmp_path: Path) -> None:
    saved = tmp_path / "run.roost"
    written: set[int] = set()

    def look(progress: roost.Progress) -> None:
        if saved.exists():
            written.add(saved.stat().st_mtime_ns)
        if len(written) > 2:
            raise StopIteration

    with pytest.raises(StopIteration):
        roost.run(slow_hopper(500.0), threads=1, checkpoint=saved, checkpoint_every=0.1, progress=look)
    roost.run(hopper(0.2), threads=1, checkpoint=saved, from_start=True, progress=False)
    assert list(tmp_path.iterdir()) == [], "deleted at the end, and no other file stays"


def test_a_checkpoint_that_cannot_be_written_is_a_warning(tmp_path: Path) -> None:
    folder = tmp_path / "gone"

    def remove(progress: roost.Progress) -> None:
        shutil.rmtree(folder, ignore_errors=True)

    with pytest.warns(RuntimeWarning, match="the checkpoint was not saved"):
        result = roost.run(LONG, threads=1, checkpoint=folder / "run.roost", checkpoint_every=0.1, progress=remove)
    assert result.end_reason == "duration"
