"""Frames of runs in this process: the files of the command, settings, Ctrl-C, and the size limit."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import roost
from conftest import Fields, hopper, physics, slow_hopper
from roost.playback import Player

SCRIPT = """
import json, sys
import roost

def show(progress):
    if progress.phase == "process":
        print("under way", flush=True)

try:
    roost.run(json.loads(sys.argv[1]), threads=1, frames=sys.argv[2], frame_interval=0.02, progress=show)
except roost.Interrupted as stop:
    print(stop.result.frames)
    raise SystemExit(3)
"""


def files(folder: Path) -> dict[str, bytes]:
    """The files of a folder by their relative paths."""
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_the_files_are_those_of_the_command(roost_run: Callable[..., Fields], tmp_path: Path) -> None:
    here, there = tmp_path / "new" / "here", tmp_path / "there"
    result = roost.run(hopper(0.2), frames=here, progress=False)
    expected = roost_run(hopper(0.2), "--backend", "cpu", "--frames", str(there))
    assert result.frames == here and physics(result.document) == physics(expected)
    written = files(here)
    assert {"frames.pvd", "run.roostframes", "vtk/surfaces.json"} <= written.keys() and len(written) > 8
    assert written == files(there)
    # Frames of an earlier run are removed, and other files stay.
    (here / "notes.txt").write_text("mine")
    again = roost.run(hopper(0.2), frames=str(here), frame_interval=0.1, frame_format="web", progress=False)
    assert files(here).keys() == {"run.roostframes", "notes.txt"}
    assert len(files(here)["run.roostframes"]) < len(written["run.roostframes"])
    roost_run(hopper(0.2), "--backend", "cpu", "--frames", str(there), "--frame-interval", "0.1", "--frame-format", "web")
    assert files(here)["run.roostframes"] == files(there)["run.roostframes"]
    # The player takes the result as it is.
    assert Player(again).content == files(here)["run.roostframes"]
    assert roost.run(hopper(0.2), frames=here, frame_format="vtk", progress=False).frames == here
    assert "run.roostframes" not in files(here) and "frames.pvd" in files(here)


def test_ctrl_c_leaves_complete_frames(tmp_path: Path) -> None:
    arguments = [sys.executable, "-c", SCRIPT, json.dumps(slow_hopper(500.0)), str(tmp_path / "frames")]
    process = subprocess.Popen(arguments, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "under way\n"
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 3, errors
    folder = Path(output.splitlines()[-1])
    stream = (folder / "run.roostframes").read_bytes()
    # A complete stream ends with the chunk LAST, and the collection lists as many files as there are.
    assert stream[-16:-12] == b"LAST" and Player(folder).content == stream
    particles = [name for name in files(folder) if name.startswith("vtk/particles_")]
    assert (folder / "frames.pvd").read_text().count("particles_") == len(particles) > 1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"frame_interval": 0.0}, "frame_interval is 0.0; allowed: a number of seconds above 0"),
        ({"frame_interval": float("nan")}, "frame_interval is nan; allowed: a number of seconds above 0"),
        ({"frame_format": "gif"}, 'frame_format is \'gif\'; allowed: "vtk", "web", "both"'),
        ({"frame_limit_mb": 0}, "frame_limit_mb is 0; allowed: whole numbers from 1 to 1000000000"),
        ({"checkpoint": "out"}, "frames and checkpoint are both given; allowed: one of them"),
    ],
)
def test_a_bad_setting_is_named_with_what_is_allowed(settings: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError) as raised:
        roost.run(hopper(0.2), frames=tmp_path / "frames", progress=False, **settings)
    assert message in str(raised.value)
    assert not (tmp_path / "frames").exists()


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    folder = tmp_path / "file" / "frames"
    with pytest.raises(roost.RoostError) as raised:
        roost.run(hopper(0.2), frames=folder, progress=False)
    assert str(raised.value).startswith(f'frames is "{folder}": ')
    assert str(raised.value).endswith("; allowed: a folder that exists or can be made, and can be written")


def test_frames_above_the_limit_are_refused_before_the_run(tmp_path: Path) -> None:
    scenario = roost.Scenario(hopper(0.2)).with_({"/numerics/duration_s": 400.0, "/numerics/output_interval_s": 0.005})
    with pytest.raises(roost.RoostError) as raised:
        roost.run(scenario, frames=tmp_path / "frames", frame_interval=0.005, frame_limit_mb=1, progress=False)
    text = str(raised.value)
    assert text.startswith("frame_interval is 0.005 s: about ") and "more than the 1 MB of frame_limit_mb" in text
    assert 'or more, frame_format="web", or a higher frame_limit_mb' in text
    assert not (tmp_path / "frames").exists()


def test_frames_that_end_early_are_a_warning(tmp_path: Path) -> None:
    folder = tmp_path / "frames"

    def remove(progress: roost.Progress) -> None:
        for file in (folder / "vtk").glob("*"):
            file.unlink()
        if (folder / "vtk").exists():
            (folder / "vtk").rmdir()

    with pytest.warns(RuntimeWarning, match="frames end at .* s of simulated time: files for ParaView cannot be written") as seen:
        result = roost.run(slow_hopper(), threads=1, frames=folder, frame_interval=0.02, progress=remove)
    assert result.end_reason == "duration" and seen[0].filename == __file__


def test_a_result_without_frames_is_not_played() -> None:
    result = roost.run(hopper(0.1), progress=False)
    assert result.frames is None
    with pytest.raises(roost.RoostError, match="no frames: roost.run"):
        Player(result)
